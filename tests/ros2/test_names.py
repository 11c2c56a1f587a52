"""Keys and tokens as captured from ROS 2 Jazzy."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.ros2 import names
from services.ros2.config import Ros2Config
from services.ros2.definitions import HASHES
from services.ros2.endpoints import gid

STAMPED = "geometry_msgs/msg/TwistStamped"
HASH = "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
ZID = "9ad893a901c6d403eb7ce40cfd5a1377"
CAPTURED = (
    f"@ros2_lv/0/{ZID}/0/4/MP/%/%/_ros2cli_10327/%cmd_vel/"
    f"geometry_msgs::msg::dds_::TwistStamped_/{HASH}/::,10:,:,:,,"
)
CLI = names.Node(0, ZID, "/", "_ros2cli_10327")


def test_a_key_is_the_captured_one() -> None:
    key = names.data_key(0, "/cmd_vel", STAMPED)
    assert key == f"0/cmd_vel/geometry_msgs::msg::dds_::TwistStamped_/{HASH}"


def test_a_token_is_the_captured_one() -> None:
    assert CLI.endpoint_token(4, "MP", "/cmd_vel", STAMPED, names.QOS) == CAPTURED
    assert CLI.token == f"@ros2_lv/0/{ZID}/0/0/NN/%/%/_ros2cli_10327"


def test_a_namespace_is_one_chunk() -> None:
    node = names.Node(7, "ab", "/site/t2", "t2")
    assert node.token == "@ros2_lv/7/ab/0/0/NN/%/%site%t2/t2"
    token = node.endpoint_token(
        3, "SS", "/site/t2/hardware/e_stop_reset", "std_srvs/srv/Trigger", ""
    )
    assert token == (
        "@ros2_lv/7/ab/0/3/SS/%/%site%t2/t2/%site%t2%hardware%e_stop_reset/"
        f"std_srvs::srv::dds_::Trigger_/{HASHES['std_srvs/srv/Trigger']}/"
    )


def test_the_token_of_a_publisher_is_read() -> None:
    assert names.publisher(CAPTURED) == (
        "/_ros2cli_10327", "/cmd_vel", names.wire_type(STAMPED),
    )  # fmt: skip
    assert names.publisher(f"{CAPTURED}/backends:cpu") == names.publisher(CAPTURED)  # Lyrical
    inner = names.Node(7, "ab", "/site/t2", "nav")
    token = inner.endpoint_token(3, "MP", "/site/t2/cmd_vel", STAMPED, names.QOS)
    assert names.publisher(token) == ("/site/t2/nav", "/site/t2/cmd_vel", names.wire_type(STAMPED))


@pytest.mark.parametrize("token", [CLI.token, "a/b", CAPTURED[:40], CAPTURED.replace("MP", "MS")])
def test_other_tokens_are_of_no_publisher(token: str) -> None:
    assert names.publisher(token) is None


def test_the_captured_gid_is_that_of_its_token() -> None:
    assert gid(CAPTURED).hex() == "6ddcb54a141ce8bf846ab67b5087d2b9"


@pytest.mark.parametrize("name", ["/", "/t2", "/a/b_1", "/_x"])
def test_ros_names(name: str) -> None:
    assert names.is_valid(name)


@pytest.mark.parametrize("name", ["", "t2", "/1", "/a//b", "/a/", "/a-b", "/a\n", "//"])
def test_other_names(name: str) -> None:
    assert not names.is_valid(name)


def test_another_name_is_refused_as_a_namespace() -> None:
    with pytest.raises(ConfigError, match="allowed is / or a name such as /t2_001"):
        load(Ros2Config, Sources(environ={}, sets=["ros2.namespace=/t2/"]))


def test_names_of_a_namespace() -> None:
    assert names.absolute("/", "odom") == "/odom"
    assert names.absolute("/t2", "odom") == "/t2/odom"
    assert names.absolute("/t2", "/tf") == "/tf"
