"""All eight sonars: each sample once, and nothing from an old one."""

import math

import pytest

from common.freshness import NS_PER_S, Latest
from common.messages import SONAR_NAMES, Ultrasonic
from common.motion import Twist
from common.settings import Vehicle
from services.safety.config import Safety
from services.safety.sonar import Rules
from services.safety.sonar_array import Ears, Heard
from services.safety.zones import zones
from tests.safety.policy_fixture import FREE, NO_ECHO

EARS = Ears(zones(Vehicle(), Safety()), Rules(0.05, 0.5), age_s=0.3, creep_room=0.26)
STEP_NS = NS_PER_S // 20


def sample(seq: int, front: float | None = None, boot: int = 1) -> Latest[Ultrasonic]:
    ranges, status = list(FREE), list(NO_ECHO)
    if front is not None:
        ranges[2], status[2] = front, "ok"
    message = Ultrasonic(ranges=tuple(ranges), status=tuple(status), seq=seq, boot=boot)
    return Latest(message, seq * STEP_NS)


def hear(count: int, front: float | None = None, linear: float = 0.0) -> Heard:
    heard = Heard()
    for seq in range(1, count + 1):
        heard = EARS.hear(heard, sample(seq, front), Twist(linear), seq * STEP_NS)
    return heard


def test_three_samples_open_all_sectors() -> None:
    assert hear(2).faults == "all silent"
    assert hear(3).faults == ""
    assert hear(3, 1.0).distances[2] == 1.0


def test_one_sample_is_taken_once() -> None:
    heard = hear(2)
    for _ in range(3):
        heard = EARS.hear(heard, sample(2), Twist(), 2 * STEP_NS)
    assert heard.faults == "all silent"


def test_an_old_sample_closes_all_sectors_and_its_repetition_opens_none() -> None:
    heard, old = hear(3), sample(3)
    limit_ns = 3 * STEP_NS + round(0.3 * NS_PER_S)
    assert EARS.hear(heard, old, Twist(), limit_ns).faults == ""
    heard = EARS.hear(heard, old, Twist(), limit_ns + 1)
    assert heard.distances == (0.0,) * 8
    assert EARS.hear(heard, old, Twist(), 3 * STEP_NS).distances == (0.0,) * 8
    assert EARS.hear(heard, None, Twist(), 3 * STEP_NS).distances == (0.0,) * 8


def test_a_constant_sonar_is_suspect_by_the_way_along_its_axis() -> None:
    assert hear(13, 2.0, linear=1.0).faults == "front suspect"
    assert hear(13, 2.0, linear=0.5).faults == ""
    heard = hear(13, 2.0, linear=1.0)
    assert [math.isinf(one) for one in heard.distances].count(True) == 7
    assert heard.distances[2] == 2.0
    assert heard.unseen == frozenset()
    assert heard.cautious[2] == 0.26
    assert hear(2).unseen == frozenset(range(8))


def test_without_fresh_samples_no_sonar_can_be_crept_past() -> None:
    assert Heard().unseen == frozenset()
    heard = EARS.hear(hear(2), sample(2), Twist(), NS_PER_S)
    assert heard.faults == "all silent"
    assert heard.unseen == frozenset()


def drive(count: int, twist: Twist, **readings: float) -> Heard:
    """Let sonars keep a reading for so many samples; the others hear no echo."""
    heard = Heard()
    ranges, status = list(FREE), list(NO_ECHO)
    for name, reading in readings.items():
        n = SONAR_NAMES.index(name)
        ranges[n], status[n] = reading, "ok"
    for seq in range(1, count + 1):
        message = Ultrasonic(ranges=tuple(ranges), status=tuple(status), seq=seq, boot=1)
        heard = EARS.hear(heard, Latest(message, seq * STEP_NS), twist, seq * STEP_NS)
    return heard


AHEAD, BACK = Twist(0.5), Twist(-0.5)


@pytest.mark.parametrize(
    ("twist", "readings", "faults"),
    [
        (AHEAD, {"front": 2.0}, "front suspect"),
        (AHEAD, {"rear": 2.0}, "rear suspect"),
        (BACK, {"rear": 2.0}, "rear suspect"),
        (AHEAD, {"left": 0.57, "right": 0.8}, ""),
        (AHEAD, {"front_left": 0.8}, "front left suspect"),
        (AHEAD, {"front_left": 0.8, "left": 0.57}, ""),
        (AHEAD, {"rear_left": 0.8, "left": 0.57}, ""),
        (BACK, {"rear_right": 0.8, "right": 0.57}, ""),
        (AHEAD, {"front_right": 0.8, "right": 0.57}, ""),
        (AHEAD, {"front_right": 0.8, "left": 0.57}, "front right suspect"),
        (AHEAD, {"front_left": 0.8, "left": 0.39}, "front left suspect"),
        (AHEAD, {"front_left": 0.8, "left": 0.89}, "front left suspect"),
        (AHEAD, {"front_left": 0.8, "left": 0.41}, ""),
        (AHEAD, {"front_left": 0.8, "left": 0.87}, ""),
        (Twist(0.0, 0.5), {"left": 0.8}, "left suspect"),
        (Twist(0.0, -0.5), {"front": 0.8}, "front suspect"),
        (Twist(0.0, 0.2), {"left": 0.8}, ""),
    ],
)
def test_what_each_mount_predicts(twist: Twist, readings: dict[str, float], faults: str) -> None:
    assert drive(31, twist, **readings).faults == faults


def test_the_sensors_greatest_reading_is_no_disagreement() -> None:
    near = {"left": 0.7, "right": 0.9, "rear": 1.2, "rear_left": 1.0, "rear_right": 1.1}
    fronts = {"front_left": 4.5, "front": 4.5, "front_right": 4.5}
    heard = drive(60, AHEAD, **near, **fronts)
    assert heard.saturation.reading == 4.5
    assert "front" not in heard.faults
    assert drive(60, AHEAD, **fronts).saturation.reading is None  # others see farther


def test_no_number_is_no_wall_alongside() -> None:
    assert drive(31, AHEAD, front_left=0.8, left=math.nan).faults == (
        "left faulty, front left suspect"
    )


@pytest.mark.parametrize("twist", [Twist(0.019), Twist(-0.019, 0.049), Twist(0.0, 0.049)])
def test_a_parked_vehicle_makes_no_sonar_suspect(twist: Twist) -> None:
    assert drive(20 * 120, twist, front=1.0, left=0.8).faults == ""


def test_an_unknown_speed_is_no_motion() -> None:
    heard = Heard()
    for seq in range(1, 30):
        heard = EARS.hear(heard, sample(seq, 2.0), None, seq * STEP_NS)
    assert heard.faults == ""
