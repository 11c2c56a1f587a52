//! Drive forward at 0.2 m/s for 2 s as the source "patrol".

use std::thread::sleep;
use std::time::{Duration, Instant};

use serde::Serialize;
use t2_examples::{open_session, Failure, SafetyState, Source};

const NAME: &str = "patrol"; // one of safety.sources
const PERIOD: Duration = Duration::from_millis(50); // 20 Hz
const STILL: Drive = Drive {
    linear: 0.0,
    angular: 0.0,
};

#[derive(Serialize)]
struct Drive {
    linear: f64,  // m/s
    angular: f64, // rad/s
}

fn main() -> Result<(), Failure> {
    let session = open_session()?;
    let mut patrol = Source::declare(&session, "drive", NAME)?;
    let done = drive(&mut patrol);
    for _ in 0..3 {
        patrol.put(&STILL)?; // three: one may be lost
        sleep(PERIOD);
    }
    done
}

fn drive(patrol: &mut Source) -> Result<(), Failure> {
    take_control(patrol)?;
    let mut shown = String::new();
    let end = Instant::now() + Duration::from_secs(2);
    while Instant::now() < end {
        patrol.put(&Drive {
            linear: 0.2,
            angular: 0.0,
        })?;
        sleep(PERIOD);
        let state = patrol.state.as_ref().ok_or("safety is silent")?;
        if !state.latched.is_empty() || is_overruled(state) {
            return Err(state.text.clone().into());
        }
        if state.text != shown {
            shown.clone_from(&state.text); // such as: slowed by an obstacle
            println!("{shown}");
        }
    }
    Ok(())
}

/// Put neutral requests until safety obeys this source, for 2 s at most.
fn take_control(patrol: &mut Source) -> Result<(), Failure> {
    for tick in 0..40 {
        patrol.put(&STILL)?;
        sleep(PERIOD);
        let state = patrol.state.as_ref();
        if tick > 10 && state.is_some_and(|it| it.source.as_deref() == Some(NAME)) {
            return Ok(());
        }
    }
    let state = patrol.state.as_ref().ok_or("safety is silent")?;
    Err(format!("safety does not obey {NAME}: {}", state.text).into())
}

fn is_overruled(state: &SafetyState) -> bool {
    state.source.as_deref().is_some_and(|source| source != NAME)
}
