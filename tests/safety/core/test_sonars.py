"""Sonars: plausibility of one, and all eight together."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from common.settings import Place, Vehicle
from services.safety.core.sonar import Moved, Sonar, trusted, updated
from services.safety.core.sonars import SHOWN_NS, SonarArray, SonarFilter, SonarOverrides, axes
from services.safety.report import _doubts
from t2.messages import SONAR_NAMES, RangeStatus, Ultrasonic
from t2.words import render
from tests.safety.core.policy_fixture import FREE, NO_ECHO

GOOD = Sonar(distance=1.0, fault="")


STILL = Moved()
ROOM_M = 0.26  # what creeping needs


def feed(sonar: Sonar, *readings: float | None, moved: Moved = STILL) -> Sonar:
    for reading in readings:
        sonar = read(sonar, reading, "ok", moved)
    return sonar


def read(sonar: Sonar, reading: float | None, status: RangeStatus, moved: Moved) -> Sonar:
    return updated(sonar, *trusted(reading, status), moved)


def along(metres: float) -> Moved:
    return Moved(along=metres)


@pytest.mark.parametrize(
    ("readings", "distance"),
    [
        ((1.2, 1.2), 1.0),
        ((1.2, 1.1, 1.3), 1.1),
        ((1.2, 1.2, 0.9, 1.2), 0.9),
        ((1.2, 1.04, 1.2, 1.2), 1.0),
        ((1.2, 1.04, 1.2, 1.3, 1.2), 1.2),
        ((1.049, 1.049, 1.049), 1.0),
        ((1.05, 1.06, 1.07), 1.05),
    ],
)
def test_farther_counts_after_three_by_5_cm(readings: tuple[float, ...], distance: float) -> None:
    assert feed(GOOD, *readings).distance == distance


@pytest.mark.parametrize(
    ("reading", "status", "fault"),
    [
        (None, "fault", "faulty"),
        (None, "too_near", "too_near"),
        (None, "ok", "faulty"),
        (-0.1, "ok", "faulty"),
    ],
)
def test_what_cannot_be_trusted_is_no_distance(
    reading: float | None, status: RangeStatus, fault: str
) -> None:
    assert trusted(reading, status) == (0.0, fault)
    bad = read(GOOD, reading, status, STILL)
    assert (bad.distance, bad.fault) == (0.0, fault)
    recovering = feed(bad, 1.0, 1.0)
    assert (recovering.distance, recovering.fault) == (0.0, fault)
    assert feed(recovering, 1.0) == Sonar(distance=1.0, fault="", same=1.0)


@pytest.mark.parametrize("reading", [0.0, 0.04])
def test_a_fault_ends_with_near_readings_too(reading: float) -> None:
    # Within the hysteresis of distance zero: the obstacle must not stay unseen.
    sonar = Sonar(fault="faulty")
    for expected in ("faulty", "faulty", ""):
        sonar = read(sonar, reading, "ok", STILL)
        assert sonar.fault == expected
    assert sonar.distance == reading


@pytest.mark.parametrize("way", [1, -1])
def test_a_reading_that_stays_along_half_a_metre_is_suspect_and_still_counts(way: int) -> None:
    sonar = feed(GOOD, 2.0, 2.0, 2.0)
    sonar = feed(sonar, *[2.0] * 4, moved=along(0.1 * way))
    assert not sonar.suspect
    sonar = feed(sonar, 2.001, moved=along(0.11 * way))
    assert sonar.suspect
    assert (sonar.fault, sonar.distance) == ("", 2.0)
    assert sonar.cautious(ROOM_M) == ROOM_M
    assert feed(sonar, 2.0, moved=along(-0.2 * way)).suspect
    assert feed(sonar, 0.1).cautious(ROOM_M) == 0.1  # nearer counts at once


def test_the_way_to_and_fro_is_the_way_between_its_ends() -> None:
    sonar = feed(GOOD, 2.0, 2.0, 2.0)
    for metres in (0.2, -0.4, 0.3, -0.3, 0.4):
        sonar = feed(sonar, 2.0, moved=along(metres))
        assert not sonar.suspect
        assert 0.0 <= sonar.nearer <= sonar.travel <= 0.41
    sonar = feed(sonar, 2.0, moved=along(0.11))
    assert sonar.suspect


def test_a_constant_reading_is_shortened_by_the_way_toward_it() -> None:
    sonar = feed(GOOD, 1.0, 1.0, 1.0)
    assert sonar.cautious(ROOM_M) == 1.0
    sonar = feed(sonar, 1.0, 1.0, moved=along(0.1))
    assert sonar.cautious(ROOM_M) == pytest.approx(0.8)
    assert feed(sonar, 1.0, moved=along(-0.1)).cautious(ROOM_M) == pytest.approx(0.9)
    assert feed(sonar, 0.9, moved=along(0.1)).cautious(ROOM_M) == pytest.approx(0.9)
    near = feed(feed(GOOD, 0.4), 0.4, moved=along(0.3))
    assert near.cautious(ROOM_M) == ROOM_M  # never blocks by doubt
    assert feed(near, 0.2).cautious(ROOM_M) == 0.2


@pytest.mark.parametrize(("turn", "suspect"), [(0.24, False), (0.25, True), (-0.26, True)])
def test_a_reading_that_stays_over_half_a_radian_is_suspect(turn: float, suspect: bool) -> None:
    sonar = feed(GOOD, 0.8, 0.8, 0.8)
    sonar = feed(sonar, 0.8, 0.8, moved=Moved(turn=turn, alongside=True))
    assert sonar.suspect is suspect
    turned = feed(GOOD, *[0.8] * 4, moved=Moved(turn=0.1))
    assert not feed(turned, 0.9, 0.9, moved=Moved(turn=0.25)).suspect  # another reading: anew


def test_half_a_metre_is_enough() -> None:
    assert feed(feed(GOOD, 2.0, 2.0), 2.0, 2.0, moved=along(0.25)).suspect


def test_a_wall_alongside_explains_a_constant_reading() -> None:
    sonar = feed(GOOD, 2.0, 2.0, 2.0)
    wall = feed(sonar, *[2.0] * 9, moved=Moved(along=0.2, alongside=True))
    assert (wall.suspect, wall.cautious(ROOM_M)) == (False, 2.0)
    suspect = feed(sonar, *[2.0] * 3, moved=along(0.2))
    assert suspect.suspect
    assert not feed(suspect, 2.0, moved=Moved(alongside=True)).suspect


def test_suspicion_ends_after_three_other_readings_in_a_row() -> None:
    suspect = feed(feed(GOOD, 2.0, 2.0, 2.0), *[2.0] * 3, moved=along(0.2))
    assert feed(suspect, 1.9, 1.8).suspect
    assert not feed(suspect, 1.9, 1.8, 1.7).suspect
    assert feed(suspect, 1.9, 1.8, 2.0, 1.7).suspect
    clear = feed(suspect, 1.9, 1.8, 1.7)
    assert clear == Sonar(distance=1.7, fault="", same=1.7)
    open_space = suspect
    for _ in range(3):
        open_space = read(open_space, None, "no_echo", STILL)
    assert (open_space.suspect, open_space.distance) == (False, math.inf)


readings = st.none() | st.floats(-1.0, 1e9)
statuses = st.sampled_from(["ok", "fault", "too_near", "no_echo"])


@given(st.lists(st.tuples(readings, statuses, st.floats(-1, 1)), max_size=20))
def test_it_never_believes_more_than_the_newest_sample_shows(
    samples: list[tuple[float | None, RangeStatus, float]],
) -> None:
    sonar = Sonar()
    for reading, status, moved in samples:
        sonar = read(sonar, reading, status, along(moved))
        shown = math.inf if status == "no_echo" else reading
        if status in ("fault", "too_near") or shown is None or not shown >= 0:
            assert sonar.distance == 0.0
        else:
            assert 0.0 <= sonar.distance <= shown
        assert not (sonar.fault and sonar.distance)
        assert sonar.cautious(ROOM_M) <= sonar.distance


FILTER = SonarFilter(axes(Vehicle()), 0.3, ROOM_M)
STEP_NS = NS_PER_S // 20


def sample(seq: int, **readings: float) -> Latest[Ultrasonic]:
    """Return a sample in which some sonars have a reading, and the others no echo."""
    ranges, status = list(FREE), list(NO_ECHO)
    for name, reading in readings.items():
        n = SONAR_NAMES.index(name)
        ranges[n], status[n] = reading, "ok"
    message = Ultrasonic(ranges=tuple(ranges), status=tuple(status), seq=seq, boot=1)
    return Latest(message, seq * STEP_NS)


def drive(count: int, twist: Twist, **readings: float) -> SonarArray:
    """Repeat a sample for ``count`` times."""
    array = SonarArray()
    for seq in range(1, count + 1):
        array = FILTER.update(array, sample(seq, **readings), twist, seq * STEP_NS)
    return array


def doubts(array: SonarArray) -> str:
    """Return the doubts as an operator reads them; empty without any."""
    text = render(_doubts(array.sonars)).removeprefix("Sonar not trusted: ").rstrip(".")
    assert bool(text) == array.is_doubted
    return text


@pytest.mark.parametrize(("reading", "room"), [(1.0, 0.9), (0.08, 0.0), (math.inf, math.inf)])
def test_a_reading_is_no_room_up_to_the_hull(reading: float, room: float) -> None:
    deep = Vehicle(sonars={"front": Place(x=0.45, y=0.0, yaw=0.0)})
    made, array = SonarFilter(axes(deep), 0.3, ROOM_M), SonarArray()
    read = {} if math.isinf(reading) else {"front": reading, "rear": reading}
    for seq in range(1, 4):
        array = made.update(array, sample(seq, **read), Twist(), seq * STEP_NS)
    front, rear = (array.sonars[SONAR_NAMES.index(name)] for name in ("front", "rear"))
    assert front.distance == pytest.approx(room)
    assert rear.distance == reading
    assert not front.fault


def test_an_old_sample_closes_all_sectors_and_its_repetition_opens_none() -> None:
    array, old = drive(3, Twist()), sample(3)
    limit_ns = 3 * STEP_NS + round(0.3 * NS_PER_S)
    assert doubts(FILTER.update(array, old, Twist(), limit_ns)) == ""
    array = FILTER.update(array, old, Twist(), limit_ns + 1)
    assert array.distances == (0.0,) * 8
    assert FILTER.update(array, old, Twist(), 3 * STEP_NS).distances == (0.0,) * 8
    assert FILTER.update(array, None, Twist(), 3 * STEP_NS).distances == (0.0,) * 8


def test_without_fresh_samples_no_sonar_can_be_crept_past() -> None:
    assert SonarArray().unseen == frozenset()
    array = FILTER.update(drive(2, Twist()), sample(2), Twist(), NS_PER_S)
    assert doubts(array) == "All sonars are silent"
    assert array.unseen == frozenset()


AHEAD, BACK = Twist(0.5), Twist(-0.5)


@pytest.mark.parametrize(
    ("twist", "readings", "faults"),
    [
        (AHEAD, {"front": 2.0}, "front (suspect)"),
        (AHEAD, {"rear": 2.0}, "rear (suspect)"),
        (BACK, {"rear": 2.0}, "rear (suspect)"),
        (AHEAD, {"left": 0.57, "right": 0.8}, ""),
        (AHEAD, {"front_left": 0.8}, "front left (suspect)"),
        (AHEAD, {"front_left": 0.8, "left": 0.57}, ""),
        (AHEAD, {"rear_left": 0.8, "left": 0.57}, ""),
        (BACK, {"rear_right": 0.8, "right": 0.57}, ""),
        (AHEAD, {"front_right": 0.8, "right": 0.57}, ""),
        (AHEAD, {"front_right": 0.8, "left": 0.57}, "front right (suspect)"),
        (AHEAD, {"front_left": 0.8, "left": 0.39}, "front left (suspect)"),
        (AHEAD, {"front_left": 0.8, "left": 0.89}, "front left (suspect)"),
        (AHEAD, {"front_left": 0.8, "left": 0.41}, ""),
        (AHEAD, {"front_left": 0.8, "left": 0.87}, ""),
        (Twist(0.0, 0.5), {"left": 0.8}, "left (suspect)"),
        (Twist(0.0, -0.5), {"front": 0.8}, "front (suspect)"),
        (Twist(0.0, 0.2), {"left": 0.8}, ""),
    ],
)
def test_what_each_mount_predicts(twist: Twist, readings: dict[str, float], faults: str) -> None:
    assert doubts(drive(31, twist, **readings)) == faults


def test_a_parked_vehicle_makes_no_sonar_suspect() -> None:
    assert doubts(drive(20 * 60, Twist(-0.019, 0.049), front=1.0, left=0.8)) == ""


def test_each_sample_counts_once() -> None:
    once = FILTER.update(SonarArray(), sample(1, front=2.0), None, STEP_NS)
    assert FILTER.update(once, sample(1, front=2.0), None, STEP_NS) is once


# --- overrides of faulty sonars ---------------------------------------------------------------


def test_a_neutral_request_counts_once_the_fault_was_shown_for_a_second() -> None:
    overrides = SonarOverrides().updated({2}, {"teleop": 5}, 5)
    assert overrides.acknowledged_by("teleop") == frozenset()
    assert (
        overrides.updated({2}, {"teleop": 4 + SHOWN_NS}, 5 + SHOWN_NS).acknowledged_by("teleop")
        == frozenset()
    )
    overrides = overrides.updated({2}, {"teleop": 5 + SHOWN_NS}, 6 + SHOWN_NS)
    assert overrides.acknowledged_by("teleop") == {2}
    assert overrides.acknowledged_by("web") == overrides.acknowledged_by(None) == frozenset()
    assert SHOWN_NS == NS_PER_S
