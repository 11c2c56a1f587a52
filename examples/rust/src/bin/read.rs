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
        let nearest = sonars.ranges.iter().flatten().copied().reduce(f64::min);
        println!(
            "x {:.2} m  y {:.2} m  heading {:.2} rad  nearest {}",
            pose.x,
            pose.y,
            pose.heading,
            nearest.map_or("-".into(), |range| format!("{range:.2} m")),
        );
    }
}
