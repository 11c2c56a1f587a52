//! Print the pose and the nearest obstacle, twice a second.

use std::{thread::sleep, time::Duration};

use serde::Deserialize;
use t2_examples::{open_session, Failure, Newest};

#[derive(Deserialize)]
struct Odometry {
    x: f64,       // m
    y: f64,       // m
    heading: f64, // rad
}

#[derive(Deserialize)]
struct Ultrasonic {
    ranges: Vec<Option<f64>>, // m; None: no echo, too near, or a fault
    status: Vec<String>,
}

fn main() -> Result<(), Failure> {
    let session = open_session()?;
    let odometry = Newest::subscribe(&session, "tel/odom/odometry")?;
    let ultrasonic = Newest::subscribe(&session, "tel/bridge/ultrasonic")?;
    loop {
        sleep(Duration::from_millis(500));
        let pose: Option<Odometry> = odometry.take()?;
        let sonars: Option<Ultrasonic> = ultrasonic.take()?;
        let (Some(pose), Some(sonars)) = (pose, sonars) else {
            println!("no data for 0.5 s");
            continue;
        };
        println!(
            "x {:.2} m  y {:.2} m  heading {:.2} rad  nearest {:.2} m",
            pose.x,
            pose.y,
            pose.heading,
            nearest(&sonars),
        );
    }
}

/// Return the distance to the nearest obstacle; a sonar that cannot measure counts as 0.
fn nearest(sonars: &Ultrasonic) -> f64 {
    let measured = sonars.ranges.iter().zip(&sonars.status);
    measured.fold(f64::INFINITY, |nearest, (range, status)| {
        let unknown = if status == "no_echo" {
            f64::INFINITY
        } else {
            0.0
        };
        nearest.min(range.unwrap_or(unknown))
    })
}
