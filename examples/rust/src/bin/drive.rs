//! Drive forward at 0.2 m/s for 2 s as the source "shuttle".

use std::thread::sleep;
use std::time::{Duration, Instant};

use serde::Serialize;
use t2_examples::{open_session, Failure, SafetyState, Source};

const NAME: &str = "shuttle"; // one of safety.sources
const PERIOD: Duration = Duration::from_millis(50); // 20 Hz
const STILL: Drive = Drive {
    linear: 0.0,
    angular: 0.0,
};
const FORWARD: Drive = Drive {
    linear: 0.2,
    angular: 0.0,
};

#[derive(Serialize)]
struct Drive {
    linear: f64,  // m/s
    angular: f64, // rad/s
}

fn main() -> Result<(), Failure> {
    let session = open_session()?;
    let mut shuttle = Source::declare(&session, "drive", NAME)?;
    let done = drive(&mut shuttle);
    for _ in 0..3 {
        shuttle.put(&STILL)?; // three: one may be lost
        sleep(PERIOD);
    }
    done
}

fn drive(shuttle: &mut Source) -> Result<(), Failure> {
    take_control(shuttle)?;
    let end = Instant::now() + Duration::from_secs(2);
    while Instant::now() < end {
        shuttle.put(&FORWARD)?;
        sleep(PERIOD);
        if let Some(stopped) = reason(shuttle.state.as_ref()) {
            return Err(stopped.into());
        }
    }
    Ok(())
}

/// Put neutral requests until safety would let this source drive, for 2 s at most.
fn take_control(shuttle: &mut Source) -> Result<(), Failure> {
    for tick in 0..40 {
        shuttle.put(&STILL)?;
        sleep(PERIOD);
        let state = shuttle.state.as_ref();
        let in_control = state.is_some_and(|it| it.source.as_deref() == Some(NAME));
        if tick > 10 && in_control && reason(state).is_none() {
            return Ok(());
        }
    }
    let why = reason(shuttle.state.as_ref())
        .unwrap_or("safety.sources or your certificate does not name it".into());
    Err(format!("safety does not obey {NAME}: {why}").into())
}

/// Return why safety does not move the vehicle for this source; None if it does.
fn reason(state: Option<&SafetyState>) -> Option<String> {
    let Some(state) = state else {
        return Some("safety is silent".into());
    };
    for cause in &state.causes {
        if cause.action != "slow" && cause.name != "no_request" {
            return Some(cause.text.clone());
        }
    }
    match state.source.as_deref() {
        None | Some(NAME) => None,
        Some(other) => Some(format!("{other} drives")),
    }
}
