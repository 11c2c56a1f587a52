"""Checks with hiroz, an independent implementation of ROS 2; each returns its observation.

``tests/ros2`` compares every payload with rosbags, and its values with what the robot measures.
"""

from collections.abc import Callable
from typing import Any

from verification.harness.waiting import wait_until
from verification.ros2.robot import STILL_M, Robot

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
RECEIVED = {
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/sonar_front/range": "sensor_msgs/msg/Range",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/robot_description": "std_msgs/msg/String",
}
STAMPED, PLAIN = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
AHEAD = 0.4, 0.0, 2.0  # m/s, rad/s, s
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
    odom, tf, sonar, static, described = (last(robot, *each) for each in RECEIVED.items())
    assert (odom["header"]["frame_id"], odom["child_frame_id"]) == ("odom", "base_link"), odom
    assert len(odom["pose"]["covariance"]) == 36, odom
    (moving,) = tf["transforms"]
    assert moving["child_frame_id"] == "base_link", moving
    assert moving["transform"]["rotation"]["w"] > 0.99, moving
    assert sonar["header"]["frame_id"] == "sonar_front", sonar
    assert sonar["min_range"] <= sonar["range"] <= sonar["max_range"], sonar
    sonars = [it for it in static["transforms"] if it["child_frame_id"].startswith("sonar_")]
    assert len(sonars) == 8, static
    assert '<robot name="t2">' in described["data"], described
    return f"odometry, transforms, {sonar['range']:.2f} m, {len(sonars)} sonars, URDF"


def drive(robot: Robot) -> str:
    """Drive by both types; the vehicle moves, and stands afterwards."""
    moved = [driven(robot, kind=kind) for kind in (STAMPED, PLAIN)]
    assert all(DRIVEN_M[0] < each < DRIVEN_M[1] for each in moved), moved
    return "TwistStamped moved {:.2f} m, Twist {:.2f} m".format(*moved)


def namespace(robot: Robot) -> str:
    """Use a gateway with another domain and namespace; the default ones do nothing."""
    robot.ros_domain = DOMAIN
    (found,) = robot.node("graph", NAMESPACE)
    assert ["t2", NAMESPACE] in found["nodes"], found["nodes"]
    expected = {name if name in GLOBAL else f"{NAMESPACE}{name}" for name in TOPICS}
    assert expected <= set(dict(found["publishers"])), found
    pose = last(robot, f"{NAMESPACE}/odom", "nav_msgs/msg/Odometry")
    assert pose["header"]["frame_id"] == "t2_001/odom", pose
    topic = f"{NAMESPACE}/cmd_vel"
    elsewhere, here = driven(robot), driven(robot, topic)
    robot.ros_domain = 0
    from_zero = driven(robot, topic)
    moved = f"/cmd_vel {elsewhere:.2f} m, {topic} {here:.2f} m, domain 0 {from_zero:.2f} m"
    assert max(elsewhere, from_zero) < STILL_M, moved
    assert here > DRIVEN_M[0], moved
    return f"node {NAMESPACE}/t2 in domain {DOMAIN}; /cmd_vel and domain 0 do not move it"


def stop_and_reset(robot: Robot) -> str:
    """Call the emergency stop and the reset."""
    (stopped,) = robot.node("call", "/hardware/e_stop_trigger")
    assert stopped["success"], stopped
    assert "estop" in robot.latched(), robot.state
    assert last(robot, "/hardware/e_stop", "std_msgs/msg/Bool")["data"]
    (cleared,) = robot.node("call", "/hardware/e_stop_reset")
    assert cleared["success"], cleared
    wait_until(lambda: not robot.latched(), "no latch after the reset")
    return "latched, then reset"


def driven(robot: Robot, topic: str = "/cmd_vel", kind: str = STAMPED) -> float:
    """Return the distance that the vehicle moves by commands of the node, in metres."""
    before = robot.distance()
    robot.node("drive", topic, kind, *AHEAD)
    robot.wait_standstill()
    return robot.distance() - before


def last(robot: Robot, topic: str, interface: str) -> Any:
    """Return a message of a topic."""
    return robot.node("echo", topic, interface, 1)[0]


CHECKS: tuple[Callable[[Robot], str], ...] = graph, topics, drive, stop_and_reset, namespace
