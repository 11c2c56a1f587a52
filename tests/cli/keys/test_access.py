"""Access rules by role, without a router."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from cli.keys.access import (
    LAPTOP_SERVICES,
    RouterSettings,
    Verb,
    access_control,
    rights,
    ros,
)
from cli.keys.members import Member, Members, Role, read
from common.errors import ConfigError
from services.ros2 import names
from services.ros2.config import Ros2
from services.ros2.definitions import HASHES
from t2 import keys
from tools.rights_table import MINE, OTHER, ROLES, may

UNTIL = datetime(2030, 1, 1, tzinfo=UTC)
ROUTER = RouterSettings(robot=MINE)
ON_BOARD = ("bridge", "safety", "odom", "localization", "patrol", "recorder")


def member(role: Role, name: str = "anna", robots: tuple[str, ...] = ()) -> Member:
    return Member(
        common_name=f"{role}.{name}.1", role=role, name=name, robots=robots, expires=UNTIL
    )


DRIVE, LIMIT = keys.DRIVE, keys.LIMIT
MEMBERS = ("viewer", "driver of 001", "device lidar of 001", "fleet")


@pytest.mark.parametrize("topic", [keys.MOTION, keys.MAP_POSE, keys.PATROL])
def test_no_member_may_write_what_services_decide(topic: keys.Topic[Any]) -> None:
    able = {role for role, given in ROLES.items() if may(given, "write", topic.on(MINE))}
    assert able == {"router of 001"}


@pytest.mark.parametrize("role", MEMBERS)
@pytest.mark.parametrize("robot", [MINE, OTHER])
def test_a_member_may_read_routes_and_rounds_of_each_robot(role: str, robot: str) -> None:
    for call in keys.READING_CALLS:
        assert may(ROLES[role], "ask", call.on(robot))


@pytest.mark.parametrize("call", [keys.TEACH, keys.ROUND])
def test_only_drivers_of_a_robot_may_call_its_patrol(call: keys.Call[Any, Any]) -> None:
    able = {role for role, given in ROLES.items() if may(given, "ask", call.on(MINE))}
    assert able == {"driver of 001", "driver of 001 as nav", "site's router"}


@pytest.mark.parametrize(
    ("sources", "resets"),
    [(("nav", "ros2"), False), (("nav", "teleop"), True), (("web",), True), (("checkout",), True),
     ((), False)],
)  # fmt: skip
def test_a_driver_is_limited_to_its_sources(sources: tuple[str, ...], resets: bool) -> None:
    """Of its robots; only an operator's source may reset, each may stop."""
    given = rights(replace(member("driver", "bo", (MINE,)), sources=sources), ROUTER)
    assert not may(given, "write", keys.estop_key(OTHER))
    assert {call for call in keys.CALLS if may(given, "ask", call.on(OTHER))} == {
        *keys.READING_CALLS
    }
    for call in keys.CALLS:
        is_open = call in (*keys.READING_CALLS, keys.SET_LED, keys.SET_POSE, keys.TEACH, keys.ROUND)
        assert may(given, "ask", call.on(MINE)) is (resets or is_open)
    for source in ("nav", "ros2", "teleop", "web", "pendant", "*"):
        for topic in (DRIVE, LIMIT):
            assert may(given, "write", topic.on(MINE, source=source)) is (source in sources)
            assert not may(given, "write", topic.on(OTHER, source=source))
    assert may(given, "write", keys.estop_key(MINE))


def test_a_device_is_limited_to_its_robots_and_sources_and_cannot_drive() -> None:
    given = ROLES["device lidar of 001"]
    assert may(given, "write", LIMIT.on(MINE, source="lidar"))
    assert may(given, "write", keys.FIX.on(MINE, source="lidar"))
    for key in (
        keys.FIX.on(MINE, source="amcl"),
        keys.FIX.on(OTHER, source="lidar"),
        *(LIMIT.on(MINE, source=source) for source in ("person", "*")),
        LIMIT.on(OTHER, source="lidar"),
        DRIVE.on(MINE, source="lidar"),
        keys.estop_key(OTHER),
    ):
        assert not may(given, "write", key), key
    assert {call for call in keys.CALLS if may(given, "ask", call.on(MINE))} == {
        *keys.READING_CALLS
    }
    assert not may(ROLES["driver of 001"], "write", LIMIT.on(MINE, source="lidar"))
    assert may(ROLES["site's router"], "write", LIMIT.on(OTHER, source="person"))


@pytest.mark.parametrize("role", MEMBERS)
def test_a_member_publishes_as_its_own_services_only(role: str) -> None:
    given = ROLES[role]
    for service in ON_BOARD:
        assert not may(given, "write", keys.HEALTH.on(MINE, service=service))
        assert not may(given, "write", keys.SETTINGS.on(MINE, service=service))
        assert may(given, "read", keys.SETTINGS.on(MINE, service=service))
        assert not may(given, "write", keys.EVENTS.on(MINE, service=service))
        assert not may(given, "serve", keys.info_key(MINE, service, "config"))
        assert not may(given, "live", keys.live_key(MINE, service, "1"))
    for service in LAPTOP_SERVICES:
        assert may(given, "write", keys.HEALTH.on(MINE, service=service))
        assert may(given, "write", keys.SETTINGS.on(MINE, service=service))
    verbs: tuple[Verb, ...] = ("write", "serve", "live")
    for verb in verbs:  # keys of a fixed length: a long one keeps the router busy
        assert given[verb]
        assert not [expression for expression in given[verb] if "**" in expression]
    kept = f"{keys.EVENTS.on(MINE, service='dashboard')}/@adv"
    assert may(given, "read", f"{kept}/pub/**")  # as zenoh-ext subscribes
    assert may(given, "ask", f"{kept}/**")
    assert may(given, "recall", f"{kept}/**")
    assert may(given, "serve", f"{kept}/pub/1f/uhlc/_")
    assert not may(given, "serve", f"{kept}/pub/1f/uhlc/_/a")
    assert not may(given, "read", f"{keys.VELOCITY.on(MINE)}/@adv/**"), "events alone are kept"


def test_a_name_in_the_list_cannot_leave_its_prefix(tmp_path: Path) -> None:
    file = tmp_path / "members.json"
    for name in ("*", "**", "a/b", "an$*", "@a", "a#", "a?b", "", " "):
        listed = Members(site="berlin", members=(member("driver", name, (MINE,)),))
        file.write_bytes(msgspec.json.encode(listed))
        with pytest.raises(ConfigError, match="is no list of members"):
            read(file)


@pytest.mark.parametrize("robots", [(MINE,), (OTHER,), (MINE, OTHER), ("*",), ()])
def test_own_keys_are_at_the_robots_of_the_certificate(robots: tuple[str, ...]) -> None:
    """A viewer names no robot: its keys are at each."""
    given = rights(member("driver" if robots else "viewer", "bo.1-x", robots), ROUTER)
    for robot in (MINE, OTHER, "*"):
        allowed = robot in robots or "*" in robots or not robots
        for verb in ("write", "serve", "live"):
            prefix = keys.app_key(robot, "bo.1-x")
            for key in (prefix, f"{prefix}/a", f"{prefix}/1/2/3/4/5/6"):
                assert may(given, verb, key) is allowed, (verb, key)
            for key in (f"{prefix}/1/2/3/4/5/6/7", f"{prefix}/**", f"{prefix}/@adv/a"):
                assert not may(given, verb, key), (verb, key)
            for name in ("bo.1-xx", "bo.1-", "bo", "*", "**", "bo$*"):
                assert not may(given, verb, f"{keys.app_key(robot, name)}/a")


def test_a_robots_router_writes_only_its_own_keys() -> None:
    given = rights(member("robot", OTHER), ROUTER)
    for topic in keys.TOPICS:
        names = {"service": "x", "side": "left", "source": "x", "camera": "x"}
        assert may(given, "write", topic.on(OTHER, **names))
        assert not may(given, "write", topic.on(MINE, **names))


def test_a_ros_computer_has_rights_at_the_routers_of_its_robots_only() -> None:
    for robots in ((MINE,), ("*",), (OTHER,), ()):
        given = rights(member("ros", "laptop", robots), ROUTER)
        assert given == (ROLES["ros of 001"] if {MINE, "*"} & {*robots} else {})


def test_a_ros_computer_writes_only_keys_of_fixed_length() -> None:
    given = ROLES["ros of 001"]
    assert not [each for verb in ("write", "live") for each in given[verb] if "**" in each]
    assert "serve" not in given
    node = names.Node(0, "9a", "/t2", "nav")
    endpoint = node.endpoint_token(3, "SC", "/a/b", "std_srvs/srv/Trigger", names.QOS)
    for token in (node.token, endpoint, endpoint + "/backends:cpu"):
        assert may(given, "live", token), token
    assert not may(given, "live", endpoint + "/backends:cpu/more")


def test_the_rights_of_a_ros_computer_follow_domain_and_namespace() -> None:
    given = ros(Ros2(domain=7, namespace="/site/t2"))
    twist, trigger = "geometry_msgs/msg/Twist", "std_srvs/srv/Trigger"
    assert may(given, "write", names.data_key(7, "/site/t2/cmd_vel", twist))
    assert may(given, "ask", names.data_key(7, "/site/t2/hardware/e_stop_reset", trigger))
    listed = "rcl_interfaces/srv/ListParameters"
    assert may(given, "ask", names.data_key(7, "/site/t2/t2/list_parameters", listed))
    assert may(given, "read", "@ros2_lv/7/a/0/0/NN/%/%/n")
    for key in ("7/cmd_vel", "0/site/t2/cmd_vel"):
        assert not may(given, "write", f"{key}/{names.wire_type(twist)}/{HASHES[twist]}")


def test_a_ros_computer_writes_the_poses_that_the_settings_name() -> None:
    """A topic of the namespace and an absolute one; no fix under the bus's own key."""
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    given = ros(Ros2(namespace="/t2_001", fixes={"amcl": "/amcl_pose", "tags": "tags/pose"}))
    for topic in ("/amcl_pose", "/t2_001/tags/pose"):
        assert may(given, "write", names.data_key(0, topic, kind))
        assert not may(ros(Ros2()), "write", names.data_key(0, topic, kind))
    for key in (names.data_key(0, "/map_pose", kind), keys.FIX.on(MINE, source="amcl")):
        assert not may(given, "write", key)


def test_zenohs_configuration_has_no_empty_part() -> None:
    """Zenoh refuses the whole of it for one: of a trusted protocol, or of a member's rights."""
    members = [member("ros", "lab", (OTHER,)), member("viewer")]
    for trusted, ids in (["lo"], ["onboard", "viewer.anna.1"]), ([], ["viewer.anna.1"]):
        made: dict[str, Any] = access_control(members, trusted, ROUTER)
        assert [subject["id"] for subject in made["subjects"]] == ids
        assert [policy["subjects"] for policy in made["policies"]] == [[each] for each in ids]
        assert all(policy["rules"] for policy in made["policies"])
        assert {rule["id"].split()[0] for rule in made["rules"]} == {*ids}
