//! Interfaces of ROS 2; hiroz computes their type hashes from these fields.

use hiroz::msg::{SerdeCdrSerdes, ZMessage, ZService};
use hiroz::{MessageTypeInfo, ServiceTypeInfo, entity::TypeHash, entity::TypeInfo};
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

/// Defines a message by its name in ROS and its fields.
macro_rules! message {
    // As tokens: the derive macro does not recognise types that were parsed once.
    ($ros:literal, $name:ident { $($fields:tt)* }) => {
        #[derive(Debug, Clone, Serialize, Deserialize, MessageTypeInfo)]
        #[ros_msg(type_name = $ros)]
        pub struct $name { $($fields)* }

        impl ZMessage for $name {
            type Serdes = SerdeCdrSerdes<$name>;
        }
    };
}

message!("builtin_interfaces/msg/Time", Time { pub sec: i32, pub nanosec: u32 });
message!("std_msgs/msg/Header", Header { pub stamp: Time, pub frame_id: String });
message!("std_msgs/msg/String", Text { pub data: String });
message!("std_msgs/msg/Bool", Bool { pub data: bool });
message!("geometry_msgs/msg/Vector3", Vector3 { pub x: f64, pub y: f64, pub z: f64 });
message!("geometry_msgs/msg/Point", Point { pub x: f64, pub y: f64, pub z: f64 });
message!("geometry_msgs/msg/Quaternion", Quaternion { pub x: f64, pub y: f64, pub z: f64, pub w: f64 });
message!("geometry_msgs/msg/Pose", Pose { pub position: Point, pub orientation: Quaternion });
message!("geometry_msgs/msg/Twist", Twist { pub linear: Vector3, pub angular: Vector3 });
message!("geometry_msgs/msg/TwistStamped", TwistStamped { pub header: Header, pub twist: Twist });
message!("geometry_msgs/msg/PoseWithCovariance", PoseWithCovariance {
    pub pose: Pose,
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
});
message!("geometry_msgs/msg/TwistWithCovariance", TwistWithCovariance {
    pub twist: Twist,
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
});
message!("geometry_msgs/msg/Transform", Transform { pub translation: Vector3, pub rotation: Quaternion });
message!("geometry_msgs/msg/TransformStamped", TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
});
message!("nav_msgs/msg/Odometry", Odometry {
    pub header: Header,
    pub child_frame_id: String,
    pub pose: PoseWithCovariance,
    pub twist: TwistWithCovariance,
});
message!("sensor_msgs/msg/Range", Range {
    pub header: Header,
    pub radiation_type: u8,
    pub field_of_view: f32,
    pub min_range: f32,
    pub max_range: f32,
    pub range: f32,
    pub variance: f32,
});
message!("tf2_msgs/msg/TFMessage", TFMessage { pub transforms: Vec<TransformStamped> });
message!("std_srvs/srv/Trigger_Request", TriggerRequest {});
message!("std_srvs/srv/Trigger_Response", TriggerResponse { pub success: bool, pub message: String });

/// Service std_srvs/srv/Trigger; hiroz computes no hashes of services.
pub struct Trigger;

impl ServiceTypeInfo for Trigger {
    fn service_type_info() -> TypeInfo {
        let hash = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f";
        let hash = TypeHash::from_rihs_string(hash).expect("a hash of 32 bytes");
        TypeInfo::new("std_srvs::srv::dds_::Trigger_", hash)
    }
}

impl ZService for Trigger {
    type Request = TriggerRequest;
    type Response = TriggerResponse;
}
