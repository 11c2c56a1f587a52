"""The plain peer and the gateway agree, though neither was written from the other."""

import pytest

from services.ros2 import cdr, names
from verification.ros2 import plain_peer
from verification.ros2.plain_peer import Twist, decoded_pose, text

STAMPED = "geometry_msgs/msg/TwistStamped"
ABOUT = {
    "nav_msgs/msg/Odometry": plain_peer.ODOMETRY,
    STAMPED: plain_peer.TWIST,
    "std_msgs/msg/String": plain_peer.TEXT,
    "std_srvs/srv/Trigger": plain_peer.TRIGGER,
}


@pytest.mark.parametrize("interface", ABOUT)
def test_keys(interface: str) -> None:
    assert names.data_key(0, "/a/b", interface) == f"0/a/b/{ABOUT[interface]}"


def test_a_command() -> None:
    payload = Twist(linear=0.4, angular=-0.2, lateral=0.1).encode()
    assert cdr.decode(STAMPED, payload) == (
        ((0, 0), "base_link"),
        ((0.4, 0.1, 0.0), (0.0, 0.0, -0.2)),
    )


@pytest.mark.parametrize("prefix", ["", "t2_001/", "abc/"])
def test_a_pose(prefix: str) -> None:
    pose = (1.5, -2.5, 0.0), (0.0, 0.0, 0.0, 1.0)
    twist = (0.3, 0.0, 0.0), (0.0, 0.0, 0.1)
    message = (
        ((1, 2), f"{prefix}odom"),
        f"{prefix}base_link",
        (pose, (0.0,) * 36),
        (twist, (0.0,) * 36),
    )
    assert decoded_pose(cdr.encode("nav_msgs/msg/Odometry", message)) == (1.5, -2.5)


def test_a_string() -> None:
    assert text(cdr.encode("std_msgs/msg/String", ("<robot/>",)), 4)[0] == "<robot/>"
