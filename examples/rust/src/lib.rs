//! What the programs share: the session, safety's state, and requests with their header and echo.

use std::error::Error;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde::{de::DeserializeOwned, Deserialize, Serialize};
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

pub type Failure = Box<dyn Error + Send + Sync>;

const ROOT: &str = "t2/v1/001"; // 001: the robot's id

/// Connect to a router at an endpoint, or as a Zenoh configuration file (`.json5`) describes.
pub fn open_session() -> Result<Session, Failure> {
    let router = std::env::args().nth(1);
    let router = router.as_deref().unwrap_or("tcp/127.0.0.1:7447");
    let config = if router.ends_with(".json5") {
        zenoh::Config::from_file(router)?
    } else {
        zenoh::Config::from_json5(&format!(
            r#"{{mode: "client", connect: {{endpoints: ["{router}"], timeout_ms: 3000}},
                scouting: {{multicast: {{enabled: false}}}}}}"#
        ))?
    };
    zenoh::open(config).wait()
}

/// The newest message of a key: older ones are dropped, so a slow reader never falls behind.
pub struct Newest(Subscriber<RingChannelHandler<Sample>>);

impl Newest {
    pub fn subscribe(session: &Session, path: &str) -> Result<Self, Failure> {
        let key = format!("{ROOT}/{path}");
        let ring = RingChannel::new(1);
        Ok(Self(session.declare_subscriber(key).with(ring).wait()?))
    }

    /// Return the message that arrived since the last call, if any.
    pub fn take<T: DeserializeOwned>(&self) -> Result<Option<T>, Failure> {
        let Some(sample) = self.0.try_recv()? else {
            return Ok(None);
        };
        Ok(Some(rmp_serde::from_slice(&sample.payload().to_bytes())?))
    }
}

/// Fields of `tel/safety/state`; serde ignores all others.
#[derive(Deserialize, Default)]
pub struct SafetyState {
    pub heartbeat: u64,
    pub source: Option<String>,
    pub causes: Vec<Cause>, // the worst first
}

/// One reason why the vehicle may not move as requested.
#[derive(Deserialize)]
pub struct Cause {
    pub name: String,
    pub action: String, // slow, stop or brake
    pub text: String,
}

#[derive(Serialize)]
struct Request<'a, T> {
    seq: u64,
    boot: u64,
    t_ns: u64, // for recordings
    echo: u64,
    #[serde(flatten)]
    body: &'a T,
}

/// Publisher of one source's requests to safety.
pub struct Source<'a> {
    pub state: Option<SafetyState>, // the newest; None while safety is silent
    received: Instant,              // when it arrived
    publisher: Publisher<'a>,
    states: Newest,
    boot: u64,
    seq: u64,
}

impl Source<'_> {
    /// Declare a source; `kind` is `drive` or `limit`.
    pub fn declare(session: &Session, kind: &str, name: &str) -> Result<Self, Failure> {
        let publisher = session
            .declare_publisher(format!("{ROOT}/@cmd/{kind}/{name}"))
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .wait()?;
        Ok(Self {
            state: None,
            received: Instant::now(),
            publisher,
            states: Newest::subscribe(session, "tel/safety/state")?,
            boot: RandomState::new().build_hasher().finish() >> 8, // random per start
            seq: 0,
        })
    }

    /// Put a request; safety refuses it when the heartbeat that it echoes is old.
    pub fn put<T: Serialize>(&mut self, body: &T) -> Result<(), Failure> {
        if let Some(state) = self.states.take()? {
            self.state = Some(state);
            self.received = Instant::now();
        } else if self.received.elapsed() > Duration::from_millis(500) {
            self.state = None;
        }
        self.seq += 1;
        let request = Request {
            seq: self.seq,
            boot: self.boot,
            t_ns: SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos() as u64,
            echo: self.state.as_ref().map_or(0, |state| state.heartbeat),
            body,
        };
        self.publisher
            .put(rmp_serde::to_vec_named(&request)?)
            .wait()
    }
}
