"""Checks with hiroz, an independent implementation of ROS 2; each returns its observation."""

from collections.abc import Callable
from typing import Any

from common import clock
from verification.harness.waiting import wait_until
from verification.ros2.robot import STILL_M, Robot, finished

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
SUBSCRIPTIONS = [
    ["/cmd_vel", "geometry_msgs::msg::dds_::TwistStamped_"],
    ["/cmd_vel", "geometry_msgs::msg::dds_::Twist_"],
]
SERVICES = {
    "/hardware/e_stop_trigger": "std_srvs::srv::dds_::Trigger_",
    "/hardware/e_stop_reset": "std_srvs::srv::dds_::Trigger_",
    "/hardware/bumper_brake": "std_srvs::srv::dds_::SetBool_",
    "/hardware/ultrasonic_brake": "std_srvs::srv::dds_::SetBool_",
}
GLOBAL = {"/tf", "/tf_static", "/diagnostics"}  # without the namespace
DOMAIN, NAMESPACE = 7, "/t2_001"
NAMESPACE_SETTINGS = (
    f"ros2.domain={DOMAIN}",
    f"ros2.namespace={NAMESPACE}",
    f"ros2.frame_prefix={NAMESPACE[1:]}/",
)
STAMPED, PLAIN = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
AHEAD = 0.4, 0.0  # m/s, rad/s
DRIVE_S = 2.0
DRIVE = "drive", "/cmd_vel", STAMPED, *AHEAD, DRIVE_S
DRIVEN_M = 0.2, 1.2  # the vehicle accelerates within its limits


def graph(robot: Robot) -> str:
    """List the node, its topics with types, and its services."""
    (found,) = robot.node("graph", "/")
    assert ["t2", "/"] in found["nodes"], found["nodes"]
    published = dict(found["publishers"])
    assert published.items() >= TOPICS.items(), published
    assert sum(name.endswith("/range") for name in published) == 8, published
    assert sorted(found["subscriptions"]) == sorted(SUBSCRIPTIONS), found["subscriptions"]
    assert dict(found["services"]) == SERVICES, found["services"]
    return f"node /t2, {len(published)} publishers, 2 subscriptions, {len(SERVICES)} services"


def topics(robot: Robot) -> str:
    """Receive streams, and latched topics though the node starts later."""
    odom = _last(robot, "/odom", "nav_msgs/msg/Odometry", 20)
    assert (odom["header"]["frame_id"], odom["child_frame_id"]) == ("odom", "base_link"), odom
    assert abs(odom["pose"]["pose"]["position"]["x"] - robot.stack.control.truth().x) < 0.1, odom
    assert len(odom["pose"]["covariance"]) == 36, odom
    (moving,) = _last(robot, "/tf", "tf2_msgs/msg/TFMessage", 5)["transforms"]
    assert moving["child_frame_id"] == "base_link", moving
    assert moving["transform"]["rotation"]["w"] > 0.99, moving
    sonar = _last(robot, "/sonar_front/range", "sensor_msgs/msg/Range", 5)
    assert sonar["header"]["frame_id"] == "sonar_front", sonar
    assert sonar["min_range"] <= sonar["range"] <= sonar["max_range"], sonar
    static = _last(robot, "/tf_static", "tf2_msgs/msg/TFMessage", 1)["transforms"]
    assert sum(one["child_frame_id"].startswith("sonar_") for one in static) == 8, static
    described = _last(robot, "/robot_description", "std_msgs/msg/String", 1)["data"]
    assert '<robot name="t2">' in described, described
    return f"odometry, transforms, {sonar['range']:.2f} m, {len(static)} static frames, URDF"


def drive(robot: Robot) -> str:
    """Drive by both types; the vehicle moves as odometry reports it, and stands afterwards."""
    observed = []
    for kind in (STAMPED, PLAIN):
        before = _x(robot)
        moved = robot.node_moves("drive", "/cmd_vel", kind, *AHEAD, DRIVE_S)
        reported = _x(robot) - before
        assert DRIVEN_M[0] < moved < DRIVEN_M[1], f"moved {moved:.2f} m"
        assert abs(reported - moved) < 0.1, f"odometry {reported:.2f} m, vehicle {moved:.2f} m"
        observed.append(f"{kind.rpartition('/')[2]} moved {moved:.2f} m")
    return ", ".join(observed)


def namespace(robot: Robot) -> str:
    """Use a gateway with another domain and namespace; the default ones do nothing."""
    robot.ros_domain = DOMAIN
    (found,) = robot.node("graph", NAMESPACE)
    assert ["t2", NAMESPACE] in found["nodes"], found["nodes"]
    expected = {name if name in GLOBAL else f"{NAMESPACE}{name}" for name in TOPICS}
    assert expected <= set(dict(found["publishers"])), found
    pose = _last(robot, f"{NAMESPACE}/odom", "nav_msgs/msg/Odometry", 1)
    assert pose["header"]["frame_id"] == "t2_001/odom", pose
    elsewhere = robot.node_moves(*DRIVE)
    topic = f"{NAMESPACE}/cmd_vel"
    here = robot.node_moves("drive", topic, *DRIVE[2:])
    robot.ros_domain = 0
    from_zero = robot.node_moves("drive", topic, *DRIVE[2:])
    assert elsewhere < STILL_M, f"moved {elsewhere:.2f} m by /cmd_vel"
    assert here > DRIVEN_M[0], f"moved {here:.2f} m by {topic}"
    assert from_zero < STILL_M, f"moved {from_zero:.2f} m from domain 0"
    return f"node {NAMESPACE}/t2 in domain {DOMAIN}; /cmd_vel and domain 0 do not move it"


def stop_and_reset(robot: Robot) -> str:
    """Trigger the emergency stop while it drives; a drive does nothing until the reset."""
    driving = robot.start_node(*DRIVE[:-1], 8.0)
    robot.wait_motion()
    (stopped,) = robot.node("call", "/hardware/e_stop_trigger")
    assert stopped["success"], stopped
    assert "estop" in robot.latched(), robot.state
    robot.wait_standstill()
    finished(driving)
    assert _last(robot, "/hardware/e_stop", "std_msgs/msg/Bool", 1)["data"]
    latched = robot.node_moves(*DRIVE)
    assert latched < STILL_M, f"moved {latched:.2f} m while latched"
    (cleared,) = robot.node("call", "/hardware/e_stop_reset")
    assert cleared["success"], cleared
    wait_until(lambda: not robot.latched(), "no latch after the reset")
    moved = robot.node_moves(*DRIVE)
    assert moved > DRIVEN_M[0], f"moved {moved:.2f} m after the reset"
    return f"latched, no motion, reset, then moved {moved:.2f} m"


def killed(robot: Robot) -> str:
    """Kill the node with SIGKILL while it drives; the vehicle stops within the lease."""
    driving = robot.start_node(*DRIVE[:-1], 30.0)
    robot.wait_motion()
    since_ns = clock.now_ns()
    driving.kill()
    observed = robot.stops_within_lease(since_ns)
    robot.check_processes()
    return observed


def _last(robot: Robot, topic: str, interface: str, count: int) -> Any:
    return robot.node("echo", topic, interface, count)[-1]


def _x(robot: Robot) -> float:
    pose = _last(robot, "/odom", "nav_msgs/msg/Odometry", 1)
    return float(pose["pose"]["pose"]["position"]["x"])


CHECKS: tuple[Callable[[Robot], str], ...] = graph, topics, drive, stop_and_reset, killed, namespace
