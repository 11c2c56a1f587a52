"""All eight sonars: each sample once, and nothing from an old one."""

import math

import pytest

from common.freshness import NS_PER_S, Latest
from common.messages import SONAR_NAMES, Ultrasonic
from common.motion import Twist
from common.settings import Vehicle
from services.safety.core.sonars import (
    SHARED_SAMPLES,
    SHOWN_NS,
    Rules,
    Saturation,
    SonarArray,
    SonarFilter,
    SonarOverrides,
    axes,
)
from services.safety.report import _doubts
from tests.safety.policy_fixture import FREE, NO_ECHO

FILTER = SonarFilter(axes(Vehicle()), Rules(0.05, 0.5), age_s=0.3, creep_room=0.26)
STEP_NS = NS_PER_S // 20


def sample(seq: int, front: float | None = None, boot: int = 1) -> Latest[Ultrasonic]:
    ranges, status = list(FREE), list(NO_ECHO)
    if front is not None:
        ranges[2], status[2] = front, "ok"
    message = Ultrasonic(ranges=tuple(ranges), status=tuple(status), seq=seq, boot=boot)
    return Latest(message, seq * STEP_NS)


def doubts(array: SonarArray) -> str:
    """Return the doubts as an operator reads them; empty without any."""
    text = _doubts(array.sonars)
    assert bool(text) == array.is_doubted
    return text


def updated(count: int, front: float | None = None, linear: float = 0.0) -> SonarArray:
    array = SonarArray()
    for seq in range(1, count + 1):
        array = FILTER.update(array, sample(seq, front), Twist(linear), seq * STEP_NS)
    return array


def test_three_samples_open_all_sectors() -> None:
    assert doubts(updated(2)) == "all silent"
    assert doubts(updated(3)) == ""
    assert updated(3, 1.0).distances[2] == 1.0


def test_one_sample_is_taken_once() -> None:
    array = updated(2)
    for _ in range(3):
        array = FILTER.update(array, sample(2), Twist(), 2 * STEP_NS)
    assert doubts(array) == "all silent"


def test_an_old_sample_closes_all_sectors_and_its_repetition_opens_none() -> None:
    array, old = updated(3), sample(3)
    limit_ns = 3 * STEP_NS + round(0.3 * NS_PER_S)
    assert doubts(FILTER.update(array, old, Twist(), limit_ns)) == ""
    array = FILTER.update(array, old, Twist(), limit_ns + 1)
    assert array.distances == (0.0,) * 8
    assert FILTER.update(array, old, Twist(), 3 * STEP_NS).distances == (0.0,) * 8
    assert FILTER.update(array, None, Twist(), 3 * STEP_NS).distances == (0.0,) * 8


def test_a_constant_sonar_is_suspect_by_the_way_along_its_axis() -> None:
    assert doubts(updated(13, 2.0, linear=1.0)) == "front suspect"
    assert doubts(updated(13, 2.0, linear=0.5)) == ""
    array = updated(13, 2.0, linear=1.0)
    assert [math.isinf(one) for one in array.distances].count(True) == 7
    assert array.distances[2] == 2.0
    assert array.unseen == frozenset()
    assert array.cautious[2] == 0.26
    assert updated(2).unseen == frozenset(range(8))


def test_without_fresh_samples_no_sonar_can_be_crept_past() -> None:
    assert SonarArray().unseen == frozenset()
    array = FILTER.update(updated(2), sample(2), Twist(), NS_PER_S)
    assert doubts(array) == "all silent"
    assert array.unseen == frozenset()


def drive(count: int, twist: Twist, **readings: float) -> SonarArray:
    """Repeat a reading of some sonars for ``count`` samples; the others have no echo."""
    array = SonarArray()
    ranges, status = list(FREE), list(NO_ECHO)
    for name, reading in readings.items():
        n = SONAR_NAMES.index(name)
        ranges[n], status[n] = reading, "ok"
    for seq in range(1, count + 1):
        message = Ultrasonic(ranges=tuple(ranges), status=tuple(status), seq=seq, boot=1)
        array = FILTER.update(array, Latest(message, seq * STEP_NS), twist, seq * STEP_NS)
    return array


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
    assert doubts(drive(31, twist, **readings)) == faults


def test_the_sensors_greatest_reading_is_no_disagreement() -> None:
    near = {"left": 0.7, "right": 0.9, "rear": 1.2, "rear_left": 1.0, "rear_right": 1.1}
    fronts = {"front_left": 4.5, "front": 4.5, "front_right": 4.5}
    array = drive(60, AHEAD, **near, **fronts)
    assert array.saturation.reading == 4.5
    assert "front" not in doubts(array)
    assert drive(60, AHEAD, **fronts).saturation.reading is None  # others see farther


def test_no_number_is_no_wall_alongside() -> None:
    assert doubts(drive(31, AHEAD, front_left=0.8, left=math.nan)) == (
        "left faulty, front left suspect"
    )


@pytest.mark.parametrize("twist", [Twist(0.019), Twist(-0.019, 0.049), Twist(0.0, 0.049)])
def test_a_parked_vehicle_makes_no_sonar_suspect(twist: Twist) -> None:
    assert doubts(drive(20 * 120, twist, front=1.0, left=0.8)) == ""


def test_an_unknown_speed_is_no_motion() -> None:
    array = SonarArray()
    for seq in range(1, 30):
        array = FILTER.update(array, sample(seq, 2.0), None, seq * STEP_NS)
    assert doubts(array) == ""


# --- greatest range of the sensors ------------------------------------------------------------

SHARED = (3.0, 0.5, 3.001, 0.0)


def after(saturation: Saturation, *samples: tuple[float, ...], times: int = 1) -> Saturation:
    for _ in range(times):
        for sample in samples:
            saturation = saturation.updated(sample)
    return saturation


KNOWN = after(Saturation(), SHARED, times=SHARED_SAMPLES)


def test_it_takes_a_second_of_sharing() -> None:
    assert after(Saturation(), SHARED, times=SHARED_SAMPLES - 1).reading is None
    assert KNOWN.reading == 3.001
    assert SHARED_SAMPLES == 20


@pytest.mark.parametrize(
    "other",
    [(3.0, 0.5, 0.7, 0.0), (3.0, 0.5, 3.0, 4.0), (3.0, 3.0, 3.0, math.inf), (2.9, 2.9, 0.5, 0.5)],
)
def test_anything_else_begins_anew(other: tuple[float, ...]) -> None:
    some = after(Saturation(), SHARED, times=SHARED_SAMPLES - 1)
    assert after(some, other, SHARED).reading is None


def test_it_explains_itself_and_nothing_else() -> None:
    assert KNOWN.explains(3.0)
    assert KNOWN.explains(3.002)
    assert not KNOWN.explains(2.9995)
    assert not KNOWN.explains(3.0026)
    assert not Saturation().explains(3.0)


def test_it_is_remembered_until_a_sonar_sees_farther() -> None:
    assert after(KNOWN, (1.0, 0.5, 0.7, 0.0), (2.0, 2.0, 0.0, 0.0)).reading == 3.001
    assert after(KNOWN, (3.002, 0.5, 0.7, 0.0)).reading == 3.001
    assert after(KNOWN, (3.1, 0.5, 0.7, 0.0)).reading is None
    assert after(KNOWN, (1.0, 0.5, math.inf, 0.0)).reading is None


# --- overrides of faulty sonars ---------------------------------------------------------------

ALL: set[int] = {2, 3}


def test_a_neutral_request_counts_once_the_fault_was_shown_for_a_second() -> None:
    overrides = SonarOverrides().updated({2}, {"teleop"}, 5)
    assert overrides.acknowledged_by("teleop") == frozenset()
    assert (
        overrides.updated({2}, {"teleop"}, 5 + SHOWN_NS - 1).acknowledged_by("teleop")
        == frozenset()
    )
    overrides = overrides.updated({2}, {"teleop"}, 5 + SHOWN_NS)
    assert overrides.acknowledged_by("teleop") == {2}
    assert overrides.acknowledged_by("web") == overrides.acknowledged_by(None) == frozenset()
    assert SHOWN_NS == NS_PER_S


def test_it_is_known_until_the_sonar_is_back() -> None:
    known = SonarOverrides().updated({2}, set(), 0).updated({2}, {"web"}, 2 * NS_PER_S)
    assert known.updated({2}, set(), 60 * NS_PER_S).acknowledged_by("web") == {2}
    again = known.updated(set(), set(), 3 * NS_PER_S).updated({2}, {"web"}, 4 * NS_PER_S)
    assert again.acknowledged_by("web") == frozenset()


def test_another_fault_has_to_be_known_as_well() -> None:
    known = (
        SonarOverrides()
        .updated({2}, set(), 0)
        .updated({2}, {"web"}, 2 * NS_PER_S)
        .updated(ALL, {"web"}, 3 * NS_PER_S)
    )
    assert known.acknowledged_by("web") == {2}
    assert known.updated(ALL, {"web"}, 4 * NS_PER_S).acknowledged_by("web") == ALL
