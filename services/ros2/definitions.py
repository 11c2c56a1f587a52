"""The ROS 2 interfaces that the gateway uses: fields in the order of the wire, type hashes. Pure.

Written down from the public interface packages of ROS 2 Jazzy. A field's type is a primitive, a
name of this table, either with ``[N]`` or ``[]``. Constants are not listed: they are not sent.

The hashes (RIHS01) are those of every ROS 2 from Iron to Lyrical; a peer with another hash receives
nothing.
"""

Fields = tuple[tuple[str, str], ...]

FIELDS: dict[str, Fields] = {
    "builtin_interfaces/msg/Time": (("sec", "int32"), ("nanosec", "uint32")),
    "std_msgs/msg/Header": (("stamp", "builtin_interfaces/msg/Time"), ("frame_id", "string")),
    "std_msgs/msg/Bool": (("data", "bool"),),
    "std_msgs/msg/String": (("data", "string"),),
    "geometry_msgs/msg/Point": (("x", "float64"), ("y", "float64"), ("z", "float64")),
    "geometry_msgs/msg/Vector3": (("x", "float64"), ("y", "float64"), ("z", "float64")),
    "geometry_msgs/msg/Quaternion": (
        ("x", "float64"), ("y", "float64"), ("z", "float64"), ("w", "float64"),
    ),
    "geometry_msgs/msg/Pose": (
        ("position", "geometry_msgs/msg/Point"), ("orientation", "geometry_msgs/msg/Quaternion"),
    ),
    "geometry_msgs/msg/PoseWithCovariance": (
        ("pose", "geometry_msgs/msg/Pose"), ("covariance", "float64[36]"),
    ),
    "geometry_msgs/msg/Twist": (
        ("linear", "geometry_msgs/msg/Vector3"), ("angular", "geometry_msgs/msg/Vector3"),
    ),
    "geometry_msgs/msg/TwistStamped": (
        ("header", "std_msgs/msg/Header"), ("twist", "geometry_msgs/msg/Twist"),
    ),
    "geometry_msgs/msg/TwistWithCovariance": (
        ("twist", "geometry_msgs/msg/Twist"), ("covariance", "float64[36]"),
    ),
    "geometry_msgs/msg/Transform": (
        ("translation", "geometry_msgs/msg/Vector3"),
        ("rotation", "geometry_msgs/msg/Quaternion"),
    ),
    "geometry_msgs/msg/TransformStamped": (
        ("header", "std_msgs/msg/Header"),
        ("child_frame_id", "string"),
        ("transform", "geometry_msgs/msg/Transform"),
    ),
    "tf2_msgs/msg/TFMessage": (("transforms", "geometry_msgs/msg/TransformStamped[]"),),
    "nav_msgs/msg/Odometry": (
        ("header", "std_msgs/msg/Header"),
        ("child_frame_id", "string"),
        ("pose", "geometry_msgs/msg/PoseWithCovariance"),
        ("twist", "geometry_msgs/msg/TwistWithCovariance"),
    ),
    "sensor_msgs/msg/Range": (
        ("header", "std_msgs/msg/Header"),
        ("radiation_type", "uint8"),
        ("field_of_view", "float32"),
        ("min_range", "float32"),
        ("max_range", "float32"),
        ("range", "float32"),
        ("variance", "float32"),
    ),
    "diagnostic_msgs/msg/KeyValue": (("key", "string"), ("value", "string")),
    "diagnostic_msgs/msg/DiagnosticStatus": (
        ("level", "byte"),
        ("name", "string"),
        ("message", "string"),
        ("hardware_id", "string"),
        ("values", "diagnostic_msgs/msg/KeyValue[]"),
    ),
    "diagnostic_msgs/msg/DiagnosticArray": (
        ("header", "std_msgs/msg/Header"), ("status", "diagnostic_msgs/msg/DiagnosticStatus[]"),
    ),
    "rcl_interfaces/msg/Log": (
        ("stamp", "builtin_interfaces/msg/Time"),
        ("level", "uint8"),
        ("name", "string"),
        ("msg", "string"),
        ("file", "string"),
        ("function", "string"),
        ("line", "uint32"),
    ),
    "std_srvs/srv/Trigger_Request": (),
    "std_srvs/srv/Trigger_Response": (("success", "bool"), ("message", "string")),
}  # fmt: skip

DIGESTS = """
5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e diagnostic_msgs/msg/DiagnosticArray
9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a geometry_msgs/msg/Twist
5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64 geometry_msgs/msg/TwistStamped
3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0 nav_msgs/msg/Odometry
e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac rcl_interfaces/msg/Log
b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a sensor_msgs/msg/Range
feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9 std_msgs/msg/Bool
df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18 std_msgs/msg/String
eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f std_srvs/srv/Trigger
e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087 tf2_msgs/msg/TFMessage
"""
HASHES = {name: f"RIHS01_{digest}" for digest, name in map(str.split, DIGESTS.splitlines()[1:])}
