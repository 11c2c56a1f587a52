"""Checks with hiroz, an independent implementation of ROS 2; each returns its observation."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from verification.harness.waiting import wait_until
from verification.ros2.fixture import STILL_M, Robot, finished

TOPICS = {
    "/odom": "nav_msgs::msg::dds_::Odometry_",
    "/tf": "tf2_msgs::msg::dds_::TFMessage_",
    "/tf_static": "tf2_msgs::msg::dds_::TFMessage_",
    "/robot_description": "std_msgs::msg::dds_::String_",
    "/sonar_front/range": "sensor_msgs::msg::dds_::Range_",
    "/bumper": "std_msgs::msg::dds_::Bool_",
    "/hardware/e_stop": "std_msgs::msg::dds_::Bool_",
    "/diagnostics": "diagnostic_msgs::msg::dds_::DiagnosticArray_",
}
COMMANDS = [
    ["/cmd_vel", "geometry_msgs::msg::dds_::TwistStamped_"],
    ["/cmd_vel", "geometry_msgs::msg::dds_::Twist_"],
]
GLOBAL = {"/tf", "/tf_static", "/diagnostics"}  # without the namespace
DOMAIN, NAMESPACE = 7, "/t2_001"
SERVICES = {
    "/hardware/e_stop_trigger": "std_srvs::srv::dds_::Trigger_",
    "/hardware/e_stop_reset": "std_srvs::srv::dds_::Trigger_",
    "/hardware/bumper_brake": "std_srvs::srv::dds_::SetBool_",
    "/hardware/ultrasonic_brake": "std_srvs::srv::dds_::SetBool_",
}
STAMPED, PLAIN = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
DRIVE = "drive", "/cmd_vel", STAMPED, 0.4, 0.0, 2.0
DRIVEN_M = 0.2, 1.2  # the vehicle accelerates within its limits


def graph(robot: Robot) -> str:
    """List the node, its topics with types, and its services."""
    (found,) = robot.peer_lines("graph", "/")
    assert ["t2", "/"] in found["nodes"], found["nodes"]
    published = dict(found["publishers"])
    missing = {name for name, kind in TOPICS.items() if published.get(name) != kind}
    assert not missing, f"{missing} missing in {published}"
    assert sum(name.endswith("/range") for name in published) == 8, published
    assert sorted(found["subscriptions"]) == sorted(COMMANDS), found["subscriptions"]
    assert dict(found["services"]) == SERVICES, found["services"]
    return f"node /t2, {len(published)} publishers, 2 subscriptions, {len(SERVICES)} services"


def odometry(robot: Robot) -> str:
    """Receive odometry that agrees with the simulator."""
    *_, last = robot.peer_lines("echo", "/odom", "nav_msgs/msg/Odometry", 20)
    assert last["header"]["frame_id"] == "odom", last["header"]
    assert last["child_frame_id"] == "base_link", last
    at, truth = last["pose"]["pose"]["position"], robot.truth()
    assert abs(at["x"] - truth.x) < 0.1, (at, truth)
    assert len(last["pose"]["covariance"]) == 36, last
    return f"20 messages, x = {at['x']:.2f} m, truth {truth.x:.2f} m"


def transforms(robot: Robot) -> str:
    """Receive the transform from odom to base_link."""
    *_, last = robot.peer_lines("echo", "/tf", "tf2_msgs/msg/TFMessage", 5)
    (found,) = last["transforms"]
    frames = found["header"]["frame_id"], found["child_frame_id"]
    assert frames == ("odom", "base_link"), frames
    assert found["transform"]["rotation"]["w"] > 0.99, found
    return "5 messages, odom to base_link"


def sonar(robot: Robot) -> str:
    """Receive ranges of a sonar."""
    *_, last = robot.peer_lines("echo", "/sonar_front/range", "sensor_msgs/msg/Range", 5)
    assert last["header"]["frame_id"] == "sonar_front", last
    assert last["min_range"] <= last["range"] <= last["max_range"], last
    return f"5 messages, {last['range']:.2f} m of {last['max_range']:.2f} m"


def static_transforms(robot: Robot) -> str:
    """Receive the latched static transforms, though the peer starts later."""
    (found,) = robot.peer_lines("echo", "/tf_static", "tf2_msgs/msg/TFMessage", 1)
    frames = [one["child_frame_id"] for one in found["transforms"]]
    assert sum(frame.startswith("sonar_") for frame in frames) == 8, frames
    return f"{len(frames)} frames"


def description(robot: Robot) -> str:
    """Receive the latched description, though the peer starts later."""
    (found,) = robot.peer_lines("echo", "/robot_description", "std_msgs/msg/String", 1)
    assert '<robot name="t2">' in found["data"], found
    return f"URDF of {len(found['data'])} characters"


def drive(robot: Robot) -> str:
    """Drive by TwistStamped; the vehicle moves as odometry reports it, and stands afterwards."""
    return _drives(robot, *DRIVE)


def drive_plain(robot: Robot) -> str:
    """Drive by Twist."""
    return _drives(robot, "drive", "/cmd_vel", PLAIN, *DRIVE[3:])


def namespace(robot: Robot) -> str:
    """Use a gateway with another domain and namespace; the default ones do nothing."""
    robot.ros_domain = DOMAIN
    found = robot.peer_lines("graph", NAMESPACE)[0]
    assert ["t2", NAMESPACE] in found["nodes"], found["nodes"]
    expected = {name if name in GLOBAL else f"{NAMESPACE}{name}" for name in TOPICS}
    missing = expected - set(dict(found["publishers"]))
    assert not missing, f"{missing} missing in {found}"
    pose = robot.peer_lines("echo", f"{NAMESPACE}/odom", "nav_msgs/msg/Odometry", 1)[0]
    assert pose["header"]["frame_id"] == "t2_001/odom", pose
    moved = robot.moved_during(lambda: robot.peer_lines(*DRIVE))
    assert moved < STILL_M, f"moved {moved:.2f} m by /cmd_vel"
    topic = f"{NAMESPACE}/cmd_vel"
    moved = robot.moved_during(lambda: robot.peer_lines("drive", topic, *DRIVE[2:]))
    assert moved > DRIVEN_M[0], f"moved {moved:.2f} m by {topic}"
    robot.ros_domain = 0
    moved = robot.moved_during(lambda: robot.peer_lines("drive", topic, *DRIVE[2:]))
    assert moved < STILL_M, f"moved {moved:.2f} m from domain 0"
    return f"node {NAMESPACE}/t2 in domain {DOMAIN}; /cmd_vel and domain 0 do not move it"


def stop_and_reset(robot: Robot) -> str:
    """Trigger the emergency stop while it drives; a drive does nothing until the reset."""
    driving = robot.peer(*DRIVE[:-1], 8.0)
    robot.wait_motion()
    (stopped,) = robot.peer_lines("call", "/hardware/e_stop_trigger")
    assert stopped["success"], stopped
    assert "estop" in robot.latched(), robot.state
    robot.wait_standstill()
    finished(driving)
    (latched,) = robot.peer_lines("echo", "/hardware/e_stop", "std_msgs/msg/Bool", 1)
    assert latched["data"], latched
    moved = robot.moved_during(lambda: robot.peer_lines(*DRIVE))
    assert moved < STILL_M, f"moved {moved:.2f} m while latched"
    (cleared,) = robot.peer_lines("call", "/hardware/e_stop_reset")
    assert cleared["success"], cleared
    wait_until(lambda: not robot.latched(), "no latch after the reset")
    moved = robot.moved_during(lambda: robot.peer_lines(*DRIVE))
    assert moved > DRIVEN_M[0], f"moved {moved:.2f} m after the reset"
    return f"latched, no motion, reset, then moved {moved:.2f} m"


def killed(robot: Robot) -> str:
    """Kill the peer with SIGKILL while it drives; the vehicle stops within the lease."""
    driving = robot.peer(*DRIVE[:-1], 30.0)
    robot.wait_motion()
    observed = robot.stops_within_lease(robot.killed(driving))
    assert not robot.ended(), robot.ended()
    return observed


def _drives(robot: Robot, *words: object) -> str:
    before = _x(robot)
    moved = robot.moved_during(lambda: robot.peer_lines(*words))
    assert DRIVEN_M[0] < moved < DRIVEN_M[1], f"moved {moved:.2f} m"
    reported = _x(robot) - before
    assert abs(reported - moved) < 0.1, f"odometry moved {reported:.2f} m, vehicle {moved:.2f} m"
    return f"moved {moved:.2f} m, odometry {reported:.2f} m, then stands"


def _x(robot: Robot) -> float:
    found: list[Any] = robot.peer_lines("echo", "/odom", "nav_msgs/msg/Odometry", 1)
    return float(found[0]["pose"]["pose"]["position"]["x"])


CHECKS: Sequence[Callable[[Robot], str]] = (
    graph, odometry, transforms, sonar, static_transforms, description,
    drive, drive_plain, stop_and_reset, killed, namespace,
)  # fmt: skip
SETTINGS: Mapping[str, Sequence[str]] = {  # of the gateway, by the name of the check
    "namespace": (
        f"ros2.domain={DOMAIN}",
        f"ros2.namespace={NAMESPACE}",
        f"ros2.frame_prefix={NAMESPACE[1:]}/",
    ),
}
