//! Limit the speed to 0.1 m/s as the source "detector" while something is near in front.

use std::{thread::sleep, time::Duration};

use serde::{Deserialize, Serialize};
use t2_examples::{open_session, Failure, Newest, Source};

const NEAR: f64 = 1.5; // m

#[derive(Deserialize)]
struct Ultrasonic {
    ranges: Vec<Option<f64>>,
    status: Vec<String>,
}

#[derive(Serialize)]
struct Limit {
    linear: Option<f64>, // m/s; None: no cap, zero: protective stop
    reason: String,
}

fn main() -> Result<(), Failure> {
    let session = open_session()?;
    let ultrasonic = Newest::subscribe(&session, "tel/bridge/ultrasonic")?;
    let mut detector = Source::declare(&session, "limit", "detector")?;
    loop {
        sleep(Duration::from_millis(100)); // 10 Hz, several times within the lease
        let Some(sonars) = ultrasonic.take::<Ultrasonic>()? else {
            continue; // no data, no limit: safety then applies `silence`
        };
        let nearest = front(&sonars);
        let limit = if nearest < NEAR {
            Limit {
                linear: Some(0.1),
                reason: format!("obstacle at {nearest:.1} m"),
            }
        } else {
            Limit {
                linear: None,
                reason: String::new(),
            }
        };
        detector.put(&limit)?;
    }
}

/// Return the distance to the nearest obstacle in front; a sonar that cannot measure counts as 0.
fn front(sonars: &Ultrasonic) -> f64 {
    let measured = sonars.ranges[1..4].iter().zip(&sonars.status[1..4]);
    measured.fold(f64::INFINITY, |nearest, (range, status)| {
        let unknown = if status == "no_echo" {
            f64::INFINITY
        } else {
            0.0
        };
        nearest.min(range.unwrap_or(unknown))
    })
}
