"""One sonar, sample by sample: near at once, far after three, nothing from a liar."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.messages import RangeStatus
from services.safety.core.sonars import Moved, Rules, Sonar, read

RULES = Rules(hysteresis=0.05, stuck_travel=0.5)
GOOD = Sonar(distance=1.0, fault="")


STILL = Moved()
ROOM_M = 0.26  # what creeping needs


def feed(sonar: Sonar, *readings: float | None, moved: Moved = STILL) -> Sonar:
    for reading in readings:
        sonar = read(sonar, reading, "ok", moved, RULES)
    return sonar


def along(metres: float) -> Moved:
    return Moved(along=metres)


def test_nearer_counts_at_once() -> None:
    assert feed(GOOD, 0.999).distance == 0.999


@pytest.mark.parametrize(
    ("readings", "distance"),
    [
        ((1.2, 1.2), 1.0),
        ((1.2, 1.1, 1.3), 1.1),
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
        (None, "too_near", "too near to measure"),
        (None, "ok", "faulty"),
        (math.nan, "ok", "faulty"),
        (math.inf, "ok", "faulty"),
        (-0.1, "ok", "faulty"),
    ],
)
def test_what_cannot_be_trusted_is_no_distance(
    reading: float | None, status: RangeStatus, fault: str
) -> None:
    bad = read(GOOD, reading, status, STILL, RULES)
    assert (bad.distance, bad.fault) == (0.0, fault)
    recovering = feed(bad, 1.0, 1.0)
    assert (recovering.distance, recovering.fault) == (0.0, fault)
    assert feed(recovering, 1.0) == Sonar(distance=1.0, fault="", same=1.0)


def test_a_bad_sample_begins_the_count_anew() -> None:
    bad = read(GOOD, None, "fault", STILL, RULES)
    again = read(feed(bad, 1.0, 1.0), None, "fault", STILL, RULES)
    assert feed(again, 1.0, 1.0).fault == "faulty"


@pytest.mark.parametrize("fault", ["silent", "faulty", "too near to measure"])
@pytest.mark.parametrize("reading", [0.0, 0.01, 0.06, 0.28])
def test_a_fault_ends_with_near_readings_too(fault: str, reading: float) -> None:
    # Within the hysteresis of distance zero: the obstacle must not stay unseen.
    rules = Rules(hysteresis=0.3, stuck_travel=0.5)
    sonar = Sonar(fault=fault)
    for expected in (fault, fault, ""):
        sonar = read(sonar, reading, "ok", STILL, rules)
        assert sonar.fault == expected
    assert (sonar.distance, sonar.is_unseen) == (reading, False)


def test_no_echo_is_free_space() -> None:
    sonar = GOOD
    for _ in range(3):
        sonar = read(sonar, None, "no_echo", along(1.0), RULES)
    assert sonar.distance == math.inf
    assert sonar.fault == ""


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


@pytest.mark.parametrize(("turn", "suspect"), [(0.24, False), (0.26, True), (-0.26, True)])
def test_a_reading_that_stays_over_half_a_radian_is_suspect(turn: float, suspect: bool) -> None:
    sonar = feed(GOOD, 0.8, 0.8, 0.8)
    sonar = feed(sonar, 0.8, 0.8, moved=Moved(turn=turn, alongside=True))
    assert sonar.suspect is suspect


def test_what_explains_a_constant_reading() -> None:
    sonar = feed(GOOD, 2.0, 2.0, 2.0)
    far = feed(sonar, *[2.0] * 9, moved=Moved(along=0.2, turn=0.2, beyond=True))
    assert (far.suspect, far.cautious(ROOM_M)) == (False, 2.0)
    wall = feed(sonar, *[2.0] * 9, moved=Moved(along=0.2, alongside=True))
    assert (wall.suspect, wall.cautious(ROOM_M)) == (False, 2.0)
    suspect = feed(sonar, *[2.0] * 3, moved=along(0.2))
    assert suspect.suspect
    assert not feed(suspect, 2.0, moved=Moved(beyond=True)).suspect
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
        open_space = read(open_space, None, "no_echo", STILL, RULES)
    assert (open_space.suspect, open_space.distance) == (False, math.inf)


def test_a_fault_ends_a_suspicion_and_is_worse() -> None:
    suspect = feed(feed(GOOD, 2.0, 2.0, 2.0), *[2.0] * 3, moved=along(0.2))
    assert read(suspect, None, "fault", STILL, RULES) == Sonar(fault="faulty")
    assert Sonar(fault="faulty").is_unseen
    assert Sonar(fault="silent").is_unseen
    assert not Sonar(fault="too near to measure").is_unseen
    assert not GOOD.is_unseen


readings = st.none() | st.floats(allow_nan=True, allow_infinity=True)
statuses = st.sampled_from(["ok", "fault", "too_near", "no_echo"])


@given(st.lists(st.tuples(readings, statuses, st.floats(-1, 1)), max_size=20))
def test_it_never_believes_more_than_the_newest_sample_shows(
    samples: list[tuple[float | None, RangeStatus, float]],
) -> None:
    sonar = Sonar()
    for reading, status, moved in samples:
        sonar = read(sonar, reading, status, along(moved), RULES)
        shown = math.inf if status == "no_echo" else reading
        if status in ("fault", "too_near") or shown is None or not shown >= 0:
            assert sonar.distance == 0.0
        else:
            assert 0.0 <= sonar.distance <= shown
        assert not (sonar.fault and sonar.distance)
        assert sonar.cautious(ROOM_M) <= sonar.distance
