"""The gateway on the real stack, with a node of zenoh-ros2-sdk on the other side."""

import math
import subprocess
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy
import pytest
import zenoh
import zenoh.ext

from common import child_process
from common.bus.session import client_config
from services.ros2 import names
from services.ros2.definitions import HASHES
from sim.requests import Bumper, Sonar
from t2 import codec, keys
from tests import factories
from tests.ros2 import oracle
from tests.ros2.peer import LATCHED, POSE, RosPeer, peer
from verification.harness.bus import at, set_options
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until
from verification.ros2.plain_peer import PlainPeer

pytestmark = pytest.mark.timed

STAMPED, PLAIN = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
BOOL, TRANSFORMS = "std_msgs/msg/Bool", "tf2_msgs/msg/TFMessage"
MAP = (
    "localization.sources.amcl={sigma = 0.05, heading_sigma = 0.05, places = true}",
    "ros2.fixes.amcl=/amcl_pose",
    "ros2.publish_map_tf=true",
)
STOP, RESET = "/hardware/e_stop_trigger", "/hardware/e_stop_reset"


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    folder: Path = tmp_path_factory.mktemp("ros2")

    def beside(config: Any) -> dict[str, list[str]]:
        sets = f"bus.connect={config.bus.endpoints[0]}", *MAP
        return {
            name: list(child_process.command(f"services.{name}", *set_options(*sets)))
            for name in ("ros2", "localization")
        }

    with running_stack(folder, beside=beside) as it:
        yield it


@pytest.fixture
def node(stack: RunningStack) -> Iterator[RosPeer]:
    with peer(stack.endpoint) as it:
        came = it.subscribe("/odom", "nav_msgs/msg/Odometry")
        wait_until(lambda: came, "odometry")
        yield it


def statuses(came: list[Any]) -> dict[str, Any]:
    """Return the newest diagnostic statuses by name."""
    return {status.name: status for status in came[-1].status} if came else {}


def reset(node: RosPeer) -> bool:
    """Return whether a reset was accepted, or nothing was latched."""
    answer = node.trigger(RESET, HASHES["std_srvs/srv/Trigger"])
    return answer is not None and (answer.success or "Nothing" in answer.message)


def make_ready(node: RosPeer) -> list[Any]:
    """Reset, and wait until only a request is missing; return the diagnostics."""
    wait_until(lambda: reset(node), "a reset")
    came = node.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    wait_until(
        lambda: "No command" in getattr(statuses(came).get("t2: safety"), "message", ""), "ready"
    )
    return came


def test_streams_arrive(node: RosPeer, stack: RunningStack) -> None:
    stack.control.do(Sonar(name="front", range=1.5))  # wherever other tests have driven to
    odom = node.subscribe("/odom", "nav_msgs/msg/Odometry")
    tf = node.subscribe("/tf", TRANSFORMS)
    ranges = node.subscribe("/sonar_front/range", "sensor_msgs/msg/Range")
    bumper = node.subscribe("/bumper", BOOL)
    wait_until(lambda: odom and tf and ranges and bumper, "all streams")
    assert (odom[-1].header.frame_id, odom[-1].child_frame_id) == ("odom", "base_link")
    assert odom[-1].pose.covariance[0] > 0
    (transform,) = tf[-1].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    assert ranges[-1].header.frame_id == "sonar_front"
    wait_until(lambda: ranges[-1].range == pytest.approx(1.5, abs=0.1), "the reading")
    assert ranges[-1].min_range < ranges[-1].range <= ranges[-1].max_range
    stack.control.do(Sonar(name="front"))
    assert bumper[-1].data is False


def test_latched_topics_reach_who_comes_later(node: RosPeer) -> None:
    described = node.subscribe("/robot_description", "std_msgs/msg/String", LATCHED)
    static = node.subscribe("/tf_static", TRANSFORMS, LATCHED)
    wait_until(lambda: described and static, "both latched topics")
    (link,) = ElementTree.fromstring(described[-1].data).iter("link")
    assert link.get("name") == "base_link"
    frames = {transform.child_frame_id for transform in static[-1].transforms}
    assert len([frame for frame in frames if frame.startswith("sonar_")]) == 8


def measured(stamp: Any, **at: float) -> dict[str, Any]:
    """Return header and pose of a localizer: the heading is north."""
    types = oracle.STORE.types
    half = math.sqrt(0.5)
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](**{"x": 0.0, "y": 0.0, "z": 0.0} | at),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=half, w=half),
    )
    covariance = [0.0] * 36
    covariance[0] = covariance[7] = covariance[35] = 1e-4
    with_covariance = types["geometry_msgs/msg/PoseWithCovariance"]
    return {
        "header": types["std_msgs/msg/Header"](stamp=stamp, frame_id="map"),
        "pose": with_covariance(pose=pose, covariance=numpy.array(covariance)),
    }


def test_a_localizer_of_ros_places_the_vehicle_in_the_map(
    node: RosPeer, stack: RunningStack
) -> None:
    odom = node.subscribe("/odom", "nav_msgs/msg/Odometry")
    tf, poses = node.subscribe("/tf", TRANSFORMS), node.subscribe("/map_pose", POSE)
    log = node.subscribe("/rosout", "rcl_interfaces/msg/Log")
    amcl = node.poses("/amcl_pose")
    wait_until(lambda: odom and tf, "odometry")
    assert {each.transforms[0].header.frame_id for each in tf} == {"odom"}

    def refused() -> bool:
        stamp = odom[-1].header.stamp
        amcl.publish(**measured(replace(stamp, sec=stamp.sec + 5), x=70.0))
        return any("(clock, pose of amcl)" in each.msg for each in log)

    wait_until(refused, "the refusal of a clock that is ahead")
    wait_until(lambda: "ros_fix_refused" in stack.log.read_text(), "the event")

    def placed() -> bool:
        amcl.publish(**measured(odom[-1].header.stamp, x=7.0, y=-3.0))
        return bool(poses)

    wait_until(placed, "the pose in the map")
    wait_until(lambda: len(poses) > 5, "more of them")
    last = poses[-3]  # its transforms have arrived
    assert (last.header.frame_id, last.pose.covariance[0] > 0) == ("map", True)
    assert (last.pose.pose.position.x, last.pose.pose.position.y) == pytest.approx((7, -3), abs=0.2)
    of_map: dict[Any, Any] = {}
    of_odom: dict[Any, Any] = {}
    by_frames = {("map", "odom"): of_map, ("odom", "base_link"): of_odom}
    for each in tf:
        (transform,) = each.transforms
        ends = transform.header.frame_id, transform.child_frame_id
        stamp = transform.header.stamp.sec, transform.header.stamp.nanosec
        by_frames[ends][stamp] = transform.transform
    assert len(of_map) > 3
    assert of_map.keys() <= of_odom.keys()  # tf2 finds both at one time
    stamp = last.header.stamp.sec, last.header.stamp.nanosec
    assert chained(of_map[stamp], of_odom[stamp]) == pytest.approx((7, -3), abs=0.2)


def chained(parent: Any, child: Any) -> tuple[float, float]:
    """Return x and y of a frame through the one in between."""
    yaw = 2 * math.atan2(parent.rotation.z, parent.rotation.w)
    x, y = child.translation.x, child.translation.y
    return (
        parent.translation.x + x * math.cos(yaw) - y * math.sin(yaw),
        parent.translation.y + x * math.sin(yaw) + y * math.cos(yaw),
    )


def test_parameters_can_be_listed(stack: RunningStack) -> None:
    with closing(PlainPeer(stack.endpoint)) as plain:
        assert {"ros2.cmd_vel", "vehicle.length", "limits.forward"} <= set(plain.parameters("/t2"))


def test_commands_move_the_vehicle_until_they_end(node: RosPeer, stack: RunningStack) -> None:
    make_ready(node)
    commands, odom = node.commands(STAMPED), node.subscribe("/odom", "nav_msgs/msg/Odometry")
    wait_until(lambda: odom, "odometry")
    start = odom[-1].pose.pose.position

    def moved() -> bool:
        commands.restart(0.3)
        now = odom[-1].pose.pose.position
        return math.dist((start.x, start.y), (now.x, now.y)) > 0.1

    wait_until(moved, "a motion; the first commands may precede the publisher's discovery")
    wait_until(lambda: abs(odom[-1].twist.twist.linear.x) < 0.01, "a standstill")


def test_an_emergency_stop_latches_until_a_reset(node: RosPeer) -> None:
    diagnostics = node.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    stopped = node.subscribe("/hardware/e_stop", BOOL)
    answer = node.trigger(STOP, HASHES["std_srvs/srv/Trigger"])
    assert answer.success
    wait_until(lambda: stopped and stopped[-1].data, "the latched topic")
    wait_until(
        lambda: "mergency stop" in getattr(statuses(diagnostics).get("t2: safety"), "message", ""),
        "the reason in the diagnostics",
    )
    wait_until(lambda: reset(node), "a reset")
    wait_until(lambda: not stopped[-1].data, "the latched topic")


def test_motion_across_a_reset_is_refused_until_a_pause(node: RosPeer, stack: RunningStack) -> None:
    diagnostics, commands = make_ready(node), node.commands(STAMPED)

    def moves() -> bool:
        commands.restart(0.2)
        return stack.speed() > 0.05

    wait_until(moves, "a motion")
    stack.control.do(Bumper(pressed=True))
    commands.send(0.3, 0.2)
    stack.control.do(Bumper(pressed=False))

    def is_reset() -> bool:
        commands.send(0.5, 0.2)
        return reset(node)

    wait_until(is_reset, "a reset under a running publisher")
    before = stack.control.truth().distance
    commands.send(2.0, 0.2)
    assert stack.control.truth().distance == before
    assert "Stop publishing" in statuses(diagnostics)["t2: cmd_vel"].message
    wait_until(moves, "a motion after the pause")


def test_a_contact_is_seen_at_once_and_its_reset_is_refused(
    node: RosPeer, stack: RunningStack
) -> None:
    bumper = node.subscribe("/bumper", BOOL)
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: bumper and bumper[-1].data, "the contact")
    refusals: list[str] = []

    def states_the_reason() -> bool:  # a reset just after the contact is refused for its age
        answer = node.trigger(RESET, HASHES["std_srvs/srv/Trigger"])
        assert not answer.success
        refusals.append(answer.message.lower())
        return "bumper" in refusals[-1]

    wait_until(states_the_reason, f"the reason: {refusals}")
    stack.control.do(Bumper(pressed=False))
    wait_until(lambda: reset(node), "a reset")


def test_the_diagnostics_list_only_services_that_exist(node: RosPeer, stack: RunningStack) -> None:
    diagnostics = node.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    with zenoh.open(client_config(at(stack.endpoint))) as session:

        def received() -> bool:
            for service in ("invented", "dashboard"):
                message = factories.health(service=service, version="invented")
                session.put(keys.HEALTH.on("001", service=service), codec.encode(message))
            status = statuses(diagnostics).get("t2: service dashboard")
            return status is not None and status.values[0].value == "invented"

        wait_until(received, "the dashboard's status")
    services = {name for name in statuses(diagnostics) if name.startswith("t2: service ")}
    assert services <= {f"t2: service {name}" for name in keys.SERVICES}


def test_refusals_are_in_the_diagnostics_and_in_the_log(node: RosPeer, stack: RunningStack) -> None:
    diagnostics = node.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    log = node.subscribe("/rosout", "rcl_interfaces/msg/Log")
    commands = node.commands(STAMPED)

    def refused() -> bool:
        commands.send(0.1, math.nan)
        return "not finite" in getattr(statuses(diagnostics).get("t2: cmd_vel"), "message", "")

    wait_until(refused, "the refusal")
    assert stack.speed() == 0
    wait_until(
        lambda: any("(not_finite, cmd_vel of " in each.msg for each in log),
        "the log of the refusal",
    )
    assert {(each.level, each.name) for each in log} == {(30, "t2")}
    node.commands(PLAIN)
    wait_until(lambda: "(other_type, " in log[-1].msg, "the log of a publisher of the other type")
    shown = [each.msg.encode() for each in log]
    key = names.data_key(0, "/rosout", "rcl_interfaces/msg/Log")
    late: list[bytes] = []
    history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
    with zenoh.open(client_config(at(stack.endpoint))) as session:
        zenoh.ext.declare_advanced_subscriber(
            session, key, lambda it: late.append(it.payload.to_bytes()), history=history
        )
        wait_until(lambda: all(it in b"".join(late) for it in shown), "the log of before")


def test_a_gateway_with_other_settings(node: RosPeer, stack: RunningStack) -> None:
    log = node.subscribe("/rosout", "rcl_interfaces/msg/Log")
    sets = "ros2.namespace=/strict", "ros2.cmd_vel=twist", "ros2.neutral=zero"
    options = set_options(f"bus.connect={stack.endpoint}", *sets)
    command = list(child_process.command("services.ros2", *options))
    with subprocess.Popen(command) as gateway:
        try:
            plain = node.commands(PLAIN, "/strict/cmd_vel")
            node.commands(STAMPED, "/strict/cmd_vel")

            def refused(text: str) -> bool:
                plain.send(0.2, 0.1)
                return any(text in each.msg for each in log)

            wait_until(lambda: refused("(other_type, "), "the log of a stamped publisher")
            wait_until(
                lambda: refused("(not_zero, cmd_vel of "), "the log of motion without a zero"
            )
        finally:
            gateway.terminate()


def test_a_killed_gateway_stops_the_vehicle_and_nothing_else(
    node: RosPeer, stack: RunningStack
) -> None:
    make_ready(node)
    commands = node.commands(STAMPED)

    def moves() -> bool:
        commands.restart(-0.2)
        return stack.speed() < -0.05

    wait_until(moves, "a motion")
    stack.kill("ros2")
    commands.send(0.4, -0.2)
    wait_until(lambda: stack.speed() == 0, "a standstill")
    others = {name: it.poll() for name, it in stack.processes.items() if name != "ros2"}
    assert set(others.values()) == {None}
    stack.start("ros2")
    came = node.subscribe("/odom", "nav_msgs/msg/Odometry")
    wait_until(lambda: came, "odometry from the restarted gateway")
