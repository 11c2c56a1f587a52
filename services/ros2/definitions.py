"""The ROS 2 interfaces that the gateway uses: fields in the order of the wire, type hashes. Pure.

Written down from the public interface packages of ROS 2 Jazzy. A field's type is a primitive, a
name of this table, either with ``[N]`` or ``[]``; ``[<=1]`` is a sequence of one item at most.
Constants are not listed: they are not sent.

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
    "geometry_msgs/msg/PoseWithCovarianceStamped": (
        ("header", "std_msgs/msg/Header"), ("pose", "geometry_msgs/msg/PoseWithCovariance"),
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
    "rcl_interfaces/msg/ParameterValue": (
        ("type", "uint8"),
        ("bool_value", "bool"),
        ("integer_value", "int64"),
        ("double_value", "float64"),
        ("string_value", "string"),
        ("byte_array_value", "byte[]"),
        ("bool_array_value", "bool[]"),
        ("integer_array_value", "int64[]"),
        ("double_array_value", "float64[]"),
        ("string_array_value", "string[]"),
    ),
    "rcl_interfaces/msg/Parameter": (
        ("name", "string"), ("value", "rcl_interfaces/msg/ParameterValue"),
    ),
    "rcl_interfaces/msg/FloatingPointRange": (
        ("from_value", "float64"), ("to_value", "float64"), ("step", "float64"),
    ),
    "rcl_interfaces/msg/IntegerRange": (
        ("from_value", "int64"), ("to_value", "int64"), ("step", "uint64"),
    ),
    "rcl_interfaces/msg/ParameterDescriptor": (
        ("name", "string"),
        ("type", "uint8"),
        ("description", "string"),
        ("additional_constraints", "string"),
        ("read_only", "bool"),
        ("dynamic_typing", "bool"),
        ("floating_point_range", "rcl_interfaces/msg/FloatingPointRange[<=1]"),
        ("integer_range", "rcl_interfaces/msg/IntegerRange[<=1]"),
    ),
    "rcl_interfaces/msg/ListParametersResult": (("names", "string[]"), ("prefixes", "string[]")),
    "rcl_interfaces/msg/SetParametersResult": (("successful", "bool"), ("reason", "string")),
    "rcl_interfaces/srv/DescribeParameters_Request": (("names", "string[]"),),
    "rcl_interfaces/srv/DescribeParameters_Response": (
        ("descriptors", "rcl_interfaces/msg/ParameterDescriptor[]"),
    ),
    "rcl_interfaces/srv/GetParameters_Request": (("names", "string[]"),),
    "rcl_interfaces/srv/GetParameters_Response": (
        ("values", "rcl_interfaces/msg/ParameterValue[]"),
    ),
    "rcl_interfaces/srv/GetParameterTypes_Request": (("names", "string[]"),),
    "rcl_interfaces/srv/GetParameterTypes_Response": (("types", "uint8[]"),),
    "rcl_interfaces/srv/ListParameters_Request": (("prefixes", "string[]"), ("depth", "uint64")),
    "rcl_interfaces/srv/ListParameters_Response": (
        ("result", "rcl_interfaces/msg/ListParametersResult"),
    ),
    "rcl_interfaces/srv/SetParameters_Request": (
        ("parameters", "rcl_interfaces/msg/Parameter[]"),
    ),
    "rcl_interfaces/srv/SetParameters_Response": (
        ("results", "rcl_interfaces/msg/SetParametersResult[]"),
    ),
    "rcl_interfaces/srv/SetParametersAtomically_Request": (
        ("parameters", "rcl_interfaces/msg/Parameter[]"),
    ),
    "rcl_interfaces/srv/SetParametersAtomically_Response": (
        ("result", "rcl_interfaces/msg/SetParametersResult"),
    ),
    "std_srvs/srv/Trigger_Request": (),
    "std_srvs/srv/Trigger_Response": (("success", "bool"), ("message", "string")),
}  # fmt: skip

DIGESTS = """
5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e diagnostic_msgs/msg/DiagnosticArray
26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e geometry_msgs/msg/PoseWithCovarianceStamped
9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a geometry_msgs/msg/Twist
5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64 geometry_msgs/msg/TwistStamped
3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0 nav_msgs/msg/Odometry
e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac rcl_interfaces/msg/Log
845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff rcl_interfaces/srv/DescribeParameters
da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca rcl_interfaces/srv/GetParameterTypes
bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc rcl_interfaces/srv/GetParameters
3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d rcl_interfaces/srv/ListParameters
56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0 rcl_interfaces/srv/SetParameters
0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd rcl_interfaces/srv/SetParametersAtomically
b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a sensor_msgs/msg/Range
feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9 std_msgs/msg/Bool
df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18 std_msgs/msg/String
eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f std_srvs/srv/Trigger
e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087 tf2_msgs/msg/TFMessage
"""  # noqa: E501
HASHES = {name: f"RIHS01_{digest}" for digest, name in map(str.split, DIGESTS.splitlines()[1:])}
