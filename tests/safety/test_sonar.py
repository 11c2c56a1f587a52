"""One sonar, sample by sample: near at once, far after three, nothing from a liar."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.messages import RangeStatus
from services.safety.sonar import Rules, Sonar, read

RULES = Rules(hysteresis=0.05, stuck_travel=0.5)
GOOD = Sonar(distance=1.0, fault="")


def feed(sonar: Sonar, *readings: float | None, moved: float = 0.0) -> Sonar:
    for reading in readings:
        sonar = read(sonar, reading, "ok", moved, RULES)
    return sonar


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
    bad = read(GOOD, reading, status, 0.0, RULES)
    assert (bad.distance, bad.fault) == (0.0, fault)
    recovering = feed(bad, 1.0, 1.0)
    assert (recovering.distance, recovering.fault) == (0.0, fault)
    assert feed(recovering, 1.0) == Sonar(distance=1.0, fault="", same=1.0)


def test_a_bad_sample_begins_the_count_anew() -> None:
    bad = read(GOOD, None, "fault", 0.0, RULES)
    again = read(feed(bad, 1.0, 1.0), None, "fault", 0.0, RULES)
    assert feed(again, 1.0, 1.0).fault == "faulty"


def test_no_echo_is_free_space() -> None:
    sonar = GOOD
    for _ in range(3):
        sonar = read(sonar, None, "no_echo", 1.0, RULES)
    assert sonar.distance == math.inf
    assert sonar.fault == ""


def test_a_reading_that_stays_while_the_vehicle_moves_is_stuck() -> None:
    sonar = feed(GOOD, 2.0, 2.0, 2.0)
    sonar = feed(sonar, *[2.0] * 4, moved=0.1)
    assert sonar.fault == ""
    sonar = feed(sonar, 2.001, moved=-0.1)
    assert sonar.fault == "stuck"
    assert sonar.distance == 0.0
    assert feed(sonar, 1.9, 1.8).fault == "stuck"
    assert feed(sonar, 1.9, 1.8, 1.7).fault == ""


readings = st.none() | st.floats(allow_nan=True, allow_infinity=True)
statuses = st.sampled_from(["ok", "fault", "too_near", "no_echo"])


@given(st.lists(st.tuples(readings, statuses, st.floats(-1, 1)), max_size=20))
def test_it_never_believes_more_than_the_newest_sample_shows(
    samples: list[tuple[float | None, RangeStatus, float]],
) -> None:
    sonar = Sonar()
    for reading, status, moved in samples:
        sonar = read(sonar, reading, status, moved, RULES)
        shown = math.inf if status == "no_echo" else reading
        if status in ("fault", "too_near") or shown is None or not shown >= 0:
            assert sonar.distance == 0.0
        else:
            assert 0.0 <= sonar.distance <= shown
        assert not (sonar.fault and sonar.distance)
