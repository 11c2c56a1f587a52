"""The ROS 2 interfaces that the gateway uses: their fields, in the order of the wire. Pure.

Written down from the public interface packages of ROS 2 Jazzy. A field's type is a primitive, a
name of this table, either with ``[N]`` or ``[]``. Constants are not listed: they are not sent.
"""

Fields = tuple[tuple[str, str], ...]

FIELDS: dict[str, Fields] = {
    "builtin_interfaces/msg/Time": (("sec", "int32"), ("nanosec", "uint32")),
    "builtin_interfaces/msg/Duration": (("sec", "int32"), ("nanosec", "uint32")),
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
    "rosgraph_msgs/msg/Clock": (("clock", "builtin_interfaces/msg/Time"),),
    "std_srvs/srv/Trigger_Request": (),
    "std_srvs/srv/Trigger_Response": (("success", "bool"), ("message", "string")),
    "std_srvs/srv/SetBool_Request": (("data", "bool"),),
    "std_srvs/srv/SetBool_Response": (("success", "bool"), ("message", "string")),
}  # fmt: skip
