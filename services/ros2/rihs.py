"""Type hashes (RIHS01) of the interfaces, as every ROS 2 from Iron to Lyrical computes them. Pure.

Constants, because a peer with another hash receives nothing: the tests compute them anew.
"""

PREFIX = "RIHS01_"
HASHES: dict[str, str] = {
    name: PREFIX + digest
    for name, digest in {
        "diagnostic_msgs/msg/DiagnosticArray": (
            "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"
        ),
        "geometry_msgs/msg/Twist": (
            "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
        ),
        "geometry_msgs/msg/TwistStamped": (
            "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
        ),
        "nav_msgs/msg/Odometry": (
            "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
        ),
        "rosgraph_msgs/msg/Clock": (
            "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"
        ),
        "sensor_msgs/msg/Range": (
            "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"
        ),
        "std_msgs/msg/Bool": "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
        "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
        "std_srvs/srv/SetBool": "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
        "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
        "tf2_msgs/msg/TFMessage": (
            "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
        ),
    }.items()
}
