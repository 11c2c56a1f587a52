"""Checks with hiroz, an independent implementation of ROS 2; each returns its observation.

``tests/ros2`` compares every payload with rosbags, and its values with what the robot measures.
"""

import contextlib
import json
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cli.settings import Everything
from common import child_process
from verification.faults.independent_client import Client, session
from verification.harness.bus import set_options
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

PATIENCE_S = 30.0  # of a peer's command, on a busy host
STILL_MPS = 0.001

TOPICS = {
    "/odom": "nav_msgs::msg::dds_::Odometry_",
    "/tf": "tf2_msgs::msg::dds_::TFMessage_",
    "/map_pose": "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_",
    "/tf_static": "tf2_msgs::msg::dds_::TFMessage_",
    "/robot_description": "std_msgs::msg::dds_::String_",
    "/sonar_front/range": "sensor_msgs::msg::dds_::Range_",
    "/bumper": "std_msgs::msg::dds_::Bool_",
    "/hardware/e_stop": "std_msgs::msg::dds_::Bool_",
    "/diagnostics": "diagnostic_msgs::msg::dds_::DiagnosticArray_",
    "/rosout": "rcl_interfaces::msg::dds_::Log_",
}
SUBSCRIPTIONS = [
    ["/cmd_vel", "geometry_msgs::msg::dds_::TwistStamped_"],
    ["/cmd_vel", "geometry_msgs::msg::dds_::Twist_"],
]
SERVICES = {
    "/hardware/e_stop_trigger": "std_srvs::srv::dds_::Trigger_",
    "/hardware/e_stop_reset": "std_srvs::srv::dds_::Trigger_",
    "/t2/describe_parameters": "rcl_interfaces::srv::dds_::DescribeParameters_",
    "/t2/get_parameter_types": "rcl_interfaces::srv::dds_::GetParameterTypes_",
    "/t2/get_parameters": "rcl_interfaces::srv::dds_::GetParameters_",
    "/t2/list_parameters": "rcl_interfaces::srv::dds_::ListParameters_",
    "/t2/set_parameters": "rcl_interfaces::srv::dds_::SetParameters_",
    "/t2/set_parameters_atomically": "rcl_interfaces::srv::dds_::SetParametersAtomically_",
}
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


@dataclass(frozen=True)
class Robot:
    """A running stack with the gateway, a client on its bus, and the program of the crate."""

    stack: RunningStack
    client: Client
    program: Path

    def node(self, *words: object) -> list[Any]:
        """Run the node of the crate to its end; return the JSON lines that it printed."""
        done = subprocess.run(
            [str(self.program), self.stack.endpoint, *map(str, words)],
            capture_output=True, text=True, timeout=2 * PATIENCE_S, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"exit code {done.returncode}: {done.stderr[-500:]}"
        lines = done.stdout.splitlines()
        return [json.loads(line) for line in lines if line.startswith(("{", "["))]

    def last(self, topic: str, interface: str) -> Any:
        """Return a message of a topic."""
        return self.node("echo", topic, interface, 1)[0]

    def distance(self) -> float:
        """Return the distance driven since the start, in metres."""
        return self.stack.control.truth().distance

    def is_ready(self) -> bool:
        """Return whether safety lacks at most a request."""
        causes = self.client.state.get("causes", [{"name": "no state"}])
        return {cause["name"] for cause in causes} <= {"no_request"}


@contextlib.contextmanager
def robot_with_gateway(folder: Path, program: Path) -> Iterator[Robot]:
    """Run the stack in an empty world; only a request is missing when the context begins."""

    def beside(config: Everything) -> dict[str, list[str]]:
        where = set_options(f"bus.connect={config.bus.endpoints[0]}", "ros2.cmd_vel=both")
        return {"ros2": child_process.command("services.ros2", *where)}

    with running_stack(folder, beside=beside) as stack, session(stack.endpoint) as bus:
        robot = Robot(stack, Client(bus), program)
        wait_until(robot.is_ready, "safety ready", PATIENCE_S)
        yield robot


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
    odom, tf, sonar, static, described = (robot.last(*each) for each in RECEIVED.items())
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
    moved = []
    for kind in (STAMPED, PLAIN):
        before = robot.distance()
        robot.node("drive", "/cmd_vel", kind, *AHEAD)
        wait_until(lambda: abs(robot.stack.speed()) < STILL_MPS, "a standstill", PATIENCE_S)
        moved.append(robot.distance() - before)
    assert all(DRIVEN_M[0] < each < DRIVEN_M[1] for each in moved), moved
    return "TwistStamped moved {:.2f} m, Twist {:.2f} m".format(*moved)


def stop_and_reset(robot: Robot) -> str:
    """Call the emergency stop and the reset."""
    (stopped,) = robot.node("call", "/hardware/e_stop_trigger")
    assert stopped["success"], stopped
    wait_until(lambda: "estop" in robot.client.latched, "the latch")
    assert robot.last("/hardware/e_stop", "std_msgs/msg/Bool")["data"]
    time.sleep(1.0)  # a reset that may be older than the stop is refused
    (cleared,) = robot.node("call", "/hardware/e_stop_reset")
    assert cleared["success"], cleared
    wait_until(lambda: not robot.client.latched, "no latch after the reset")
    return "latched, then reset"


CHECKS: tuple[Callable[[Robot], str], ...] = graph, topics, drive, stop_and_reset
