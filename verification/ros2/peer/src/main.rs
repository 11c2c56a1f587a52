//! An independent ROS 2 node that prints what it sees as JSON lines.
//!
//! `t2-ros2-peer ENDPOINT graph NAMESPACE`: node t2 with its publishers, subscriptions, services
//! `t2-ros2-peer ENDPOINT echo TOPIC TYPE COUNT`: messages of a topic
//! `t2-ros2-peer ENDPOINT drive TOPIC TYPE LINEAR ANGULAR SECONDS`: neutral commands, motion, neutral
//! `t2-ros2-peer ENDPOINT call SERVICE`: a call of std_srvs/srv/Trigger
//!
//! `ROS_DOMAIN_ID` is the domain.

mod messages;

use std::time::{Duration, Instant};

use hiroz::entity::EndpointKind;
use hiroz::msg::{SerdeCdrSerdes, ZMessage};
use hiroz::prelude::*;
use messages::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(15);
const PERIOD: Duration = Duration::from_millis(50);
const NEUTRAL: Duration = Duration::from_secs(1);

#[tokio::main]
async fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let Some((endpoint, words)) = words.split_first() else {
        return Err("usage: t2-ros2-peer ENDPOINT COMMAND ...".into());
    };
    let context = ZContextBuilder::default()
        .with_mode("client")
        .disable_multicast_scouting()
        .with_connect_endpoints([*endpoint])
        .build()?;
    let node = context.create_node("peer").build()?;
    match words {
        ["graph", namespace] => graph(&node, namespace).await,
        ["echo", topic, kind, count] => echo(&node, topic, kind, count.parse()?),
        ["drive", topic, kind, linear, angular, seconds] => {
            let (linear, angular) = (linear.parse()?, angular.parse()?);
            let lasts = Duration::from_secs_f64(seconds.parse()?);
            let plain = |moves| {
                if moves {
                    twist(linear, angular)
                } else {
                    twist(0.0, 0.0)
                }
            };
            match *kind {
                "geometry_msgs/msg/Twist" => drive(&node, topic, lasts, plain).await,
                "geometry_msgs/msg/TwistStamped" => {
                    drive(&node, topic, lasts, |moves| stamped(plain(moves))).await
                }
                _ => Err(format!("no command {kind}").into()),
            }
        }
        ["call", service] => call(&node, service).await,
        _ => Err("commands: graph, echo, drive, call".into()),
    }
}

/// Print the endpoints of the robot's node as soon as its services are known.
async fn graph(node: &ZNode, namespace: &str) -> Result<()> {
    let began = Instant::now();
    let root = if namespace == "/" { "" } else { namespace };
    let of = |kind| {
        let found = node
            .graph()
            .get_entities_by_node(kind, (root.into(), "t2".into()));
        let mut rows: Vec<_> = found
            .iter()
            .map(|one| {
                (
                    one.topic.clone(),
                    one.type_info.as_ref().map(|it| it.name.clone()),
                )
            })
            .collect();
        rows.sort();
        rows
    };
    while began.elapsed() < PATIENCE && of(EndpointKind::Service).len() < 4 {
        tokio::time::sleep(PERIOD).await;
    }
    print(&json!({
        "nodes": node.graph().get_node_names(),
        "publishers": of(EndpointKind::Publisher),
        "subscriptions": of(EndpointKind::Subscription),
        "services": of(EndpointKind::Service),
    }))
}

/// Print messages of a topic.
fn echo(node: &ZNode, topic: &str, kind: &str, count: usize) -> Result<()> {
    match kind {
        "nav_msgs/msg/Odometry" => receive::<Odometry>(node, topic, count, false),
        "sensor_msgs/msg/Range" => receive::<Range>(node, topic, count, false),
        "std_msgs/msg/Bool" => receive::<Bool>(node, topic, count, true),
        "std_msgs/msg/String" => receive::<Text>(node, topic, count, true),
        "tf2_msgs/msg/TFMessage" => receive::<TFMessage>(node, topic, count, topic == "/tf_static"),
        _ => Err(format!("no interface {kind}").into()),
    }
}

fn receive<T>(node: &ZNode, topic: &str, count: usize, latched: bool) -> Result<()>
where
    T: ZMessage<Serdes = SerdeCdrSerdes<T>> + WithTypeInfo,
    T: Serialize + DeserializeOwned + Send + Sync + 'static,
{
    let durability = if latched {
        QosDurability::TransientLocal
    } else {
        QosDurability::Volatile
    };
    let qos = QosProfile {
        durability,
        ..Default::default()
    };
    let subscriber = node.create_sub::<T>(topic).with_qos(qos).build()?;
    for _ in 0..count {
        print(&subscriber.recv_timeout(PATIENCE)?)?;
    }
    Ok(())
}

/// Publish commands at 20 Hz, and print when each part begins; `command` takes whether it moves.
async fn drive<T>(
    node: &ZNode,
    topic: &str,
    lasts: Duration,
    command: impl Fn(bool) -> T,
) -> Result<()>
where
    T: ZMessage<Serdes = SerdeCdrSerdes<T>> + WithTypeInfo,
    T: Serialize + Send + Sync + 'static,
{
    let publisher = node.create_pub::<T>(topic).build()?;
    let mut tick = tokio::time::interval(PERIOD);
    for (moves, lasts) in [(false, NEUTRAL), (true, lasts), (false, NEUTRAL)] {
        print(&json!({ "moves": moves }))?;
        let began = Instant::now();
        while began.elapsed() < lasts {
            tick.tick().await;
            publisher.async_publish(&command(moves)).await?;
        }
    }
    Ok(())
}

fn twist(linear: f64, angular: f64) -> Twist {
    Twist {
        linear: Vector3 {
            x: linear,
            y: 0.0,
            z: 0.0,
        },
        angular: Vector3 {
            x: 0.0,
            y: 0.0,
            z: angular,
        },
    }
}

/// Return a command with a zero stamp: the robot uses the time of the attachment.
fn stamped(twist: Twist) -> TwistStamped {
    let stamp = Time { sec: 0, nanosec: 0 };
    TwistStamped {
        header: Header {
            stamp,
            frame_id: "base_link".into(),
        },
        twist,
    }
}

/// Call a service of std_srvs/srv/Trigger as soon as it is known, and print its reply.
async fn call(node: &ZNode, service: &str) -> Result<()> {
    let began = Instant::now();
    while node
        .graph()
        .count_by_service(EndpointKind::Service, service)
        == 0
    {
        if began.elapsed() > PATIENCE {
            return Err(format!("{service} does not appear").into());
        }
        tokio::time::sleep(PERIOD).await;
    }
    let client = node.create_client::<Trigger>(service).build()?;
    print(
        &client
            .call_with_timeout(&TriggerRequest {}, PATIENCE)
            .await?,
    )
}

fn print(what: &impl Serialize) -> Result<()> {
    println!("{}", serde_json::to_string(what)?);
    Ok(())
}
