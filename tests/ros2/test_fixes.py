"""Poses of ROS nodes as fixes: the odometry that they name, and what is refused."""

import math
from typing import Any

import pytest

from common.freshness import NS_PER_S
from services.ros2 import cdr, fixes
from services.ros2.fixes import PublishedOdometry
from t2 import codec
from t2 import messages as m
from t2.words import render
from tests import factories

WALL_NS = 1_700_000_000 * NS_PER_S  # of the robot; the monotonic clock is at 0 then
PERIOD_NS = NS_PER_S // 25
NEWEST = 60
COVARIANCE = [0.0] * 36
for at, value in {0: 0.04, 1: 0.01, 6: 0.01, 7: 0.09, 5: 0.02, 30: 0.02, 35: 0.25}.items():
    COVARIANCE[at] = value


def published(count: int = NEWEST + 1) -> PublishedOdometry:
    """Return odometry of 25 Hz whose numbers count from 0."""
    made = PublishedOdometry()
    for seq in range(count):
        note(made, seq, seq * PERIOD_NS)
    return made


def note(to: PublishedOdometry, seq: int, now_ns: int, wall_ns: int = WALL_NS) -> None:
    to.note(factories.odometry(boot=9, seq=seq, t_ns=wall_ns + now_ns), now_ns)


def pose(stamp_ns: int = WALL_NS + NEWEST * PERIOD_NS, **changed: Any) -> Any:
    """Return a PoseWithCovarianceStamped, once through the wire."""
    usual = {
        "frame": "map",
        "at": (1.0, -2.0, 0.3),
        "turned": turned(yaw=0.6),
        "spread": COVARIANCE,
    }
    of: Any = usual | changed
    stamped = divmod(stamp_ns, NS_PER_S), of["frame"]
    message = stamped, ((of["at"], of["turned"]), tuple(of["spread"]))
    return cdr.decode(fixes.POSE, cdr.encode(fixes.POSE, message))


def turned(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> tuple[float, ...]:
    """Return a quaternion: first roll, then pitch, then yaw, about fixed axes."""
    (sr, cr), (sp, cp), (sy, cy) = [(math.sin(a / 2), math.cos(a / 2)) for a in (roll, pitch, yaw)]
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def fix(message: Any, of: PublishedOdometry | None = None) -> m.Fix:
    """Return the fix of a pose that is taken."""
    made = fixes.fix(message, of or published(), NEWEST * PERIOD_NS)
    assert isinstance(made, m.Fix), made
    assert codec.decode(codec.encode(made), m.Fix) == made
    return made


def refusal(message: Any, of: PublishedOdometry | None = None, late_ns: int = 0) -> str:
    """Return the reason of a pose that is refused; its text has all fields."""
    made = fixes.fix(message, of or published(), NEWEST * PERIOD_NS + late_ns)
    assert isinstance(made, m.Phrase), made
    event = m.Event(name="ros_fix_refused", level="warning", text=render([made]), phrases=(made,))
    assert codec.decode(codec.encode(event), m.Event) == event
    assert "None" not in event.text
    return made.name.removeprefix("ros_fix.")


def test_a_pose_becomes_a_fix() -> None:
    made = fix(pose())
    assert (made.x, made.y) == (1.0, -2.0)
    assert made.heading == pytest.approx(0.6)
    assert made.covariance == (0.04, 0.01, 0.02, 0.01, 0.09, 0.0, 0.02, 0.0, 0.25)
    assert (made.odom_boot, made.odom_seq) == (9, NEWEST)


@pytest.mark.parametrize("variance", [40.0, 99999.0, 1e6, 1e300])
def test_a_variance_of_a_whole_turn_is_no_heading(variance: float) -> None:
    spread = [*COVARIANCE[:35], variance]
    made = fix(pose(spread=spread))
    assert made.heading is None
    assert made.covariance == (0.04, 0.01, 0.0, 0.01, 0.09, 0.0, 0.0, 0.0, 0.0)
    assert fix(pose(spread=[*COVARIANCE[:35], 39.0])).heading is not None


@pytest.mark.parametrize(
    ("after_newest_s", "seq"),
    [(0.0, 60), (-0.001, 59), (-0.04, 59), (-0.5, 47), (-1.99, 10), (0.03, 60), (0.1, 60)],
)
def test_a_fix_names_the_odometry_that_was_newest_at_its_stamp(
    after_newest_s: float, seq: int
) -> None:
    newest_ns = WALL_NS + NEWEST * PERIOD_NS
    made = fix(pose(newest_ns + round(after_newest_s * NS_PER_S)))
    assert (made.odom_boot, made.odom_seq) == (9, seq)


@pytest.mark.parametrize("after_newest_s", [0.101, 5.0, -2.01, -3600.0, 3.6e5])
def test_a_stamp_of_another_clock_is_refused(after_newest_s: float) -> None:
    newest_ns = WALL_NS + NEWEST * PERIOD_NS
    assert refusal(pose(newest_ns + round(after_newest_s * NS_PER_S))) == "clock"


@pytest.mark.parametrize("stamp_s", [0, 17, -(2**31), 2**31 - 1])
def test_a_stamp_that_is_no_wall_clock_is_refused(stamp_s: int) -> None:
    """Zero, simulated time, and the ends of the type: their age has to fit into an event."""
    assert refusal(pose(stamp_s * NS_PER_S)) == "clock"


def test_a_stamp_in_a_gap_of_odometry_is_refused() -> None:
    of = published(30)
    note(of, 30, NEWEST * PERIOD_NS)
    assert fix(pose(WALL_NS + 29 * PERIOD_NS + NS_PER_S // 10), of).odom_seq == 29
    assert refusal(pose(WALL_NS + 29 * PERIOD_NS + NS_PER_S // 10 + 1), of) == "clock"


def test_silent_odometry_is_the_reason() -> None:
    assert refusal(pose(), PublishedOdometry()) == "no_odometry"
    assert refusal(pose(), late_ns=2 * NS_PER_S + 1) == "no_odometry"


def test_a_wall_clock_that_was_set_back_begins_anew() -> None:
    of = published(NEWEST)
    note(of, NEWEST, NEWEST * PERIOD_NS, WALL_NS - NS_PER_S)
    assert fix(pose(WALL_NS + NEWEST * PERIOD_NS - NS_PER_S), of).odom_seq == NEWEST
    assert refusal(pose(WALL_NS + 50 * PERIOD_NS), of) == "clock"
    assert of.find(9, 50) is None
    found = of.find(9, NEWEST)
    assert found is not None
    assert found.seq == NEWEST
    assert of.find(8, NEWEST) is None


@pytest.mark.parametrize("frame", ["", "odom", "/map", "r1/map", "utm", "\x1b" * 1000])
def test_another_frame_is_refused(frame: str) -> None:
    assert refusal(pose(frame=frame)) == "frame"


@pytest.mark.parametrize(
    "quaternion",
    [
        (0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 1.0, 1.0),
        (0.0, 0.0, 0.0, 0.99),
        (1e200, 0.0, 0.0, 0.0),
        turned(roll=0.31),
        turned(roll=-0.31, yaw=2.0),
        turned(pitch=0.31, yaw=-1.0),
        turned(pitch=-0.31),
        turned(roll=math.pi),
    ],
)
def test_what_is_no_orientation_of_a_vehicle_is_refused(quaternion: tuple[float, ...]) -> None:
    assert refusal(pose(turned=quaternion)) == "orientation"


@pytest.mark.parametrize("yaw", [-3.1, -1.5, 0.0, 1.0, 3.1])
@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.29, 0.0), (-0.2, 0.29)])
def test_the_heading_is_the_yaw(roll: float, pitch: float, yaw: float) -> None:
    scaled = tuple(1.004 * part for part in turned(roll, pitch, yaw))
    assert fixes.heading_of(scaled) == pytest.approx(yaw)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    "place", [("at", 0), ("at", 2), ("turned", 3), ("spread", 0), ("spread", 35)]
)
def test_a_number_that_is_not_finite_is_refused(number: float, place: tuple[str, int]) -> None:
    name, index = place
    parts: dict[str, Any] = {"at": (1.0, 2.0, 0.0), "turned": turned(), "spread": COVARIANCE}
    values = list(parts[name])
    values[index] = number
    changed: Any = {name: tuple(values)}
    assert refusal(pose(**changed)) == "not_finite"


@pytest.mark.parametrize(
    "changed", [{"at": (1.1e9, 0.0, 0.0)}, {"spread": [-1.1e9, *COVARIANCE[1:]]}]
)
def test_a_number_that_no_message_may_have_is_refused(changed: dict[str, Any]) -> None:
    assert refusal(pose(**changed)) == "not_finite"
