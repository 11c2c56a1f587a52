"""Messages of the bus as messages of ROS 2."""

import math
from typing import Any
from xml.etree import ElementTree

import pytest

from common.settings import Vehicle, sonar_mounts
from services.ros2 import translate
from services.ros2.config import Ros2, Ros2Config
from t2 import messages as m
from t2.catalogue import PHRASES
from t2.words import render
from tests import factories

T_NS = 1_700_000_000_250_000_000
STAMP = (1_700_000_000, 250_000_000)
VEHICLE = Vehicle()
HALF = math.sqrt(0.5)


def test_odometry_has_frames_pose_and_twist() -> None:
    message = factories.odometry(
        t_ns=T_NS, x=1.0, y=-2.0, heading=math.pi / 2, linear=0.3, angular=-0.1,
        pose_covariance=tuple(float(n) for n in range(1, 10)),
        twist_covariance=(11.0, 12.0, 13.0, 14.0),
    )  # fmt: skip
    header, child, (pose, pose_spread), (twist, twist_spread) = translate.odometry(message, "r1/")
    assert header == (STAMP, "r1/odom")
    assert child == "r1/base_link"
    assert pose == ((1.0, -2.0, 0.0), pytest.approx((0.0, 0.0, HALF, HALF)))
    assert twist == ((0.3, 0.0, 0.0), (0.0, 0.0, -0.1))
    assert {at: value for at, value in enumerate(pose_spread) if value} == {
        0: 1.0, 1: 2.0, 5: 3.0, 6: 4.0, 7: 5.0, 11: 6.0, 30: 7.0, 31: 8.0, 35: 9.0,
        14: 1e-6, 21: 1e-6, 28: 1e-6,
    }  # fmt: skip
    assert {at: value for at, value in enumerate(twist_spread) if value} == {
        0: 11.0, 5: 12.0, 30: 13.0, 35: 14.0, 7: 1e-6, 14: 1e-6, 21: 1e-6, 28: 1e-6
    }  # fmt: skip


def test_the_transform_is_that_of_the_odometry() -> None:
    message = factories.odometry(t_ns=T_NS, x=1.0, y=-2.0, heading=-math.pi / 2)
    (((header, child, (where, turned)),),) = translate.transform(message, "r1/")
    assert header == (STAMP, "r1/odom")
    assert child == "r1/base_link"
    assert where == (1.0, -2.0, 0.0)
    assert turned == pytest.approx((0.0, 0.0, -HALF, HALF))


def test_static_transforms_are_those_of_the_sonars() -> None:
    vehicle = Vehicle(length=1.2, width=0.8)
    (transforms,) = translate.static_transforms(T_NS, vehicle, "r1/")
    assert len(transforms) == 8
    header, child, (where, turned) = transforms[7]
    assert (header, child) == ((STAMP, "r1/base_link"), "r1/sonar_rear_left")
    assert where == (-0.6, 0.4, 0.35)
    yaw = math.radians(135)
    assert turned == pytest.approx((0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))


def test_the_description_has_the_vehicles_size() -> None:
    text = translate.description(Vehicle(length=1.2, width=0.8), "r1/")
    link = ElementTree.fromstring(text).find("link[@name='r1/base_link']")
    box = link.find("visual/geometry/box") if link is not None else None
    assert box is not None
    assert box.get("size") == "1.2 0.8 0.35"


def measured(
    index: int, distance: float | None, status: str, *, doubted: bool = False, **settings: Any
) -> Any:
    ranges: list[float | None] = [1.0] * 8
    statuses = ["ok"] * 8
    ranges[index], statuses[index] = distance, status
    message = m.Ultrasonic(ranges=tuple(ranges), status=tuple(statuses), t_ns=T_NS)  # type: ignore[arg-type]
    mount = sonar_mounts(VEHICLE)[index]
    config = Ros2Config(vehicle=VEHICLE, ros2=Ros2(**settings))
    return translate.sonar_range(message, index, mount, config, doubted=doubted)


def test_a_range_has_the_sonars_frame_and_limits() -> None:
    header, kind, opening, low, high, distance, variance = measured(
        2, 0.75, "ok", frame_prefix="r1/", sonar_fov=0.4
    )
    assert header == (STAMP, "r1/sonar_front")
    assert (kind, opening, low, high, distance, variance) == (0, 0.4, 0.05, 5.0, 0.75, 0.0)


@pytest.mark.parametrize(
    ("status", "no_echo", "expected"),
    [
        ("no_echo", "max_range", 5.0),
        ("no_echo", "inf", math.inf),
        ("too_near", "max_range", 0.05),
        ("too_near", "inf", 0.05),
    ],
)
def test_a_range_without_a_number(status: str, no_echo: str, expected: float) -> None:
    assert measured(5, None, status, no_echo=no_echo)[5] == expected


def test_by_rep_117_a_sonar_with_a_fault_is_not_a_number() -> None:
    assert math.isnan(measured(0, None, "fault", no_echo="inf")[5])


@pytest.mark.parametrize(("distance", "status"), [(1.0, "ok"), (None, "no_echo")])
def test_a_sonar_that_safety_doubts_is_faulty(distance: float | None, status: str) -> None:
    assert measured(0, distance, status, doubted=True)[5] == math.inf
    assert math.isnan(measured(0, distance, status, doubted=True, no_echo="inf")[5])


@pytest.mark.parametrize(
    ("distance", "status", "stops"),
    [(5.0, "ok", False), (0.05, "ok", False), (None, "no_echo", False), (None, "too_near", False),
     (None, "fault", True), (None, "unknown", True)],
)  # fmt: skip
def test_the_collision_monitor_of_nav2_stops_for_a_faulty_sonar(
    distance: float | None, status: str, stops: bool
) -> None:
    """By its rule: a source is invalid, and stops, when its range is outside of its limits."""
    *_, low, high, distance, _ = measured(0, distance, status)
    assert (distance < low or distance > high) == stops


@pytest.mark.parametrize(("verdict", "level"), [("run", 0), ("slow", 1), ("stop", 1), ("brake", 2)])
def test_the_status_of_safety(verdict: str, level: int) -> None:
    state = factories.contact_state(verdict=verdict)
    assert translate.safety_status(state) == (
        level, "t2: safety", "The bumper is pressed.", "t2",
        (
            ("verdict", verdict), ("source", "none"), ("latched", "contact"),
            ("linear limit", "1.0"), ("cause contact", "The bumper was hit."),
        ),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("causes", "level"), [(["no_request"], 0), (["no_request", "sonar"], 0), (["blocked"], 1)]
)
def test_a_robot_without_a_request_is_no_warning(causes: list[Any], level: int) -> None:
    held = tuple(
        m.Cause(name=name, action="slow" if name == "sonar" else "stop", age=1.0, text=name)
        for name in causes
    )
    state = factories.safety_state(verdict="stop", causes=held)
    assert translate.safety_status(state)[0] == level


def test_ros_shows_a_refusal_as_a_whole() -> None:
    shown = 128  # characters, by `ros2 topic echo`
    fields: dict[str, m.Field] = {
        "seconds": 12.5,
        "frame": "base_link",
        "map": "map",
        "reason": "it is cut",
    }
    phrases = [
        m.Phrase(name, fields) for name in PHRASES if name.startswith(("cmd_vel.", "ros_fix."))
    ]
    assert len(phrases) > 10
    for phrase in phrases:
        decision = phrase.name.partition(".")[2]
        assert len(f"{render((phrase,))} ({decision}, cmd_vel of /teleop_twist)") <= shown, phrase


@pytest.mark.parametrize(
    ("state", "armed", "level", "text"),
    [
        ("up", True, 0, "The board answers."),
        ("up", False, 1, "The board answers."),
        ("lost", False, 2, "The board is silent."),
        ("never", True, 2, "No board yet."),
    ],
)
def test_the_status_of_the_link(state: str, armed: bool, level: int, text: str) -> None:
    link = factories.link(state=state, armed=armed, waiting="a reset")
    made = translate.link_status(link)
    assert made[:3] == (level, "t2: link", text)
    assert dict(made[4]) == {"board": "10.7.5.224:4002", "armed": str(armed), "waiting": "a reset"}


def test_the_status_of_a_driver() -> None:
    faulty = m.Driver(faults=("over_current", "bit_7"), bits=130)
    assert translate.driver_status("left", faulty) == (
        2, "t2: left motor driver", "Faults: over_current, bit_7.", "t2", (("bits", "130"),)
    )  # fmt: skip
    healthy = translate.driver_status("right", m.Driver(faults=(), bits=0))
    assert healthy[:3] == (0, "t2: right motor driver", "No faults.")


def test_the_status_of_a_service() -> None:
    health = factories.health(version="1.2", uptime=60.4, counters={"resets": 3})
    made = translate.health_status("odom", health)
    assert made[:3] == (0, "t2: service odom", "It runs.")
    assert dict(made[4]) == {"version": "1.2", "uptime": "60 s", "resets": "3"}


@pytest.mark.parametrize(("level", "severity"), [(translate.OK, 20), (translate.WARN, 30)])
def test_a_log_is_one_of_the_gateways_node(level: int, severity: int) -> None:
    made = translate.log(T_NS, level, "Refused.\x1b")
    assert made == (STAMP, severity, "t2", "Refused.\\u001b", "", "", 0)


def test_a_status_is_printable() -> None:
    made = translate.status(0, "a\x1b", "b\x1b", {"c\x1b": "d\x1b"})
    assert made == (0, "t2: a\\u001b", "b\\u001b", "t2", (("c\\u001b", "d\\u001b"),))


def test_the_newest_status_of_each_name_and_a_silent_part_is_stale() -> None:
    diagnostics = translate.Diagnostics()
    link = translate.status(translate.OK, "link", "Up.", {"a": 1})
    command = translate.status(translate.OK, "cmd_vel", "Taken.", {})
    safety = translate.status(translate.OK, "safety", "Runs.", {})
    for each in (translate.status(translate.WARN, "link", "Before.", {}), link, command):
        diagnostics.note(each, T_NS)
    late_ns = T_NS + translate.STALE_NS
    diagnostics.note(safety, late_ns)
    assert diagnostics.statuses(late_ns) == (command, link, safety)
    stale = (translate.STALE, "t2: link", "Silent. Last: Up.", "t2", (("a", "1"),))
    assert diagnostics.statuses(late_ns + 1) == (command, stale, safety)


def map_pose(**fields: Any) -> m.MapPose:
    usual: dict[str, Any] = {
        "state": "lost", "x": 3.0, "y": 4.0, "heading": math.pi / 2, "text": "Lost.",
        "pose_covariance": tuple(float(n) for n in range(1, 10)),
        "odom": m.PlaneFrame(x=1.0, y=-2.0, heading=-math.pi / 2),
        "odom_boot": 9, "odom_seq": 7, "placement": 1, "t_ns": T_NS + 5_000_000,
    }  # fmt: skip
    return m.MapPose(**usual | fields)


def test_the_pose_in_the_map_has_the_stamp_of_its_odometry() -> None:
    made: Any = translate.map_pose(map_pose(), T_NS)
    header, (pose, spread) = made
    assert header == (STAMP, "map")
    assert pose == ((3.0, 4.0, 0.0), pytest.approx((0.0, 0.0, HALF, HALF)))
    assert (spread[0], spread[5], spread[35], spread[14]) == (1.0, 3.0, 9.0, 1e-6)


def test_the_transform_of_the_map_ends_at_the_prefixed_odom() -> None:
    made: Any = translate.map_transform(map_pose(), T_NS, "r1/")
    (((header, child, (where, turned)),),) = made
    assert (header, child) == ((STAMP, "map"), "r1/odom")
    assert where == (1.0, -2.0, 0.0)
    assert turned == pytest.approx((0.0, 0.0, -HALF, HALF))


def test_a_vehicle_that_is_not_placed_has_neither() -> None:
    nowhere = map_pose(
        state="unplaced", x=None, y=None, heading=None, pose_covariance=None, odom=None
    )
    assert translate.map_pose(nowhere, T_NS) is None
    assert translate.map_transform(nowhere, T_NS, "") is None
