"""Standstill supervision by the bridge while no safety service commands."""

import pytest

from common.freshness import NS_PER_S
from common.messages import Mileage, Velocity
from common.standstill import AWAY_M, AWAY_RAD, DRIFT_RADPS
from services.bridge.core.standstill import Standstill

MS = NS_PER_S // 1000
COAST, SILENCE = NS_PER_S, 200 * MS
NOW = 100 * NS_PER_S


def standstill(coast_ns: int = COAST) -> Standstill:
    return Standstill(0.6, 2.0, coast_ns, SILENCE)


def moves(still: Standstill, linear: float, angular: float, now_ns: int) -> None:
    still.on_velocity(Velocity(linear=linear, angular=angular), now_ns)


def counts(
    still: Standstill, distance: float, heading: float = 0.0, epoch: int = 0, now_ns: int = NOW
) -> None:
    still.on_mileage(Mileage(distance=distance, heading=heading, epoch=epoch), now_ns)


def left(still: Standstill) -> bool:
    """Return whether it has moved away; a function, as mypy narrows attributes."""
    return still.moved_away


def stood(at_ns: int = NOW) -> Standstill:
    """Return a supervisor at standstill, without counters yet."""
    still = standstill()
    still.on_lease(at_ns)
    moves(still, 0.0, 0.0, at_ns)
    return still


@pytest.mark.parametrize(
    ("linear", "angular", "limit_s"),
    [
        (0.0, 0.0, 0.5),
        (0.12, 0.0, 0.7),
        (-0.12, 0.0, 0.7),
        (0.0, 0.2, 0.6),
        (0.0, -0.2, 0.6),
        (0.12, 0.6, 0.8),
        (0.24, 0.6, 0.9),
        (0.28, 0.0, 0.966666667),
        (0.0, 0.49, 0.745),
        (0.8, 0.0, 1.0),  # the coast limit is sooner
    ],
)
def test_it_must_stand_by_then(linear: float, angular: float, limit_s: float) -> None:
    still = standstill()
    moves(still, linear, angular, NOW - 1)
    assert still.limit_ns == COAST
    still.on_lease(NOW)
    assert still.limit_ns == round(limit_s * NS_PER_S)
    moves(still, 0.0, 0.0, NOW + 1)
    still.on_lease(NOW)
    assert still.limit_ns == round(limit_s * NS_PER_S), "by the velocity at the end of the lease"
    still.on_lease(None)
    assert still.limit_ns == COAST


@pytest.mark.parametrize(("age", "limit_s"), [(SILENCE, 0.5), (SILENCE + 1, 1.0)])
def test_an_old_velocity_says_nothing(age: int, limit_s: float) -> None:
    still = standstill()
    moves(still, 0.0, 0.0, NOW - age)
    still.on_lease(NOW)
    assert still.limit_ns == limit_s * NS_PER_S


def test_without_a_velocity_the_coast_limit_holds() -> None:
    still = standstill()
    assert (still.limit_ns, still.moved_away) == (COAST, False)
    still.on_lease(NOW)
    assert (still.limit_ns, still.moved_away) == (COAST, False)


@pytest.mark.parametrize(
    ("distance", "heading", "left"),
    [
        (AWAY_M - 1e-6, 0.0, False), (AWAY_M, 0.0, True), (-AWAY_M, 0.0, True),
        (0.0, AWAY_RAD - 1e-6, False), (0.0, AWAY_RAD, True), (0.0, -AWAY_RAD, True),
    ],
)  # fmt: skip
def test_away_by_the_counters(distance: float, heading: float, left: bool) -> None:
    still = stood()
    counts(still, 0.0, 0.0)
    counts(still, distance, heading)
    assert still.moved_away is left


def test_the_heading_is_compared_across_half_a_turn() -> None:
    still = stood()
    counts(still, 0.0, 3.13)
    counts(still, 0.0, -3.13)
    assert not left(still)
    counts(still, 0.0, -3.09)
    assert left(still)


def test_a_board_that_counts_anew_has_not_moved() -> None:
    still = stood()
    counts(still, 7.0, 1.0)
    counts(still, 0.0, 0.0, epoch=1)
    assert not left(still)
    counts(still, 0.04, 0.0, epoch=1)
    assert not left(still)
    counts(still, 0.06, 0.0, epoch=1)
    assert left(still)


def test_counters_of_before_it_stood_do_not_count() -> None:
    still = standstill()
    counts(still, 0.0)
    still.on_lease(NOW)
    counts(still, 0.0)
    moves(still, 0.3, 0.0, NOW)
    counts(still, 0.4)
    moves(still, 0.0, 0.0, NOW + 20 * MS)
    counts(still, 0.5)
    counts(still, 0.54)
    assert not left(still)
    counts(still, 0.56)
    assert left(still)


@pytest.mark.parametrize(
    ("linear", "angular", "samples"),
    [(0.5, 0.0, 7), (-0.5, 0.0, 7), (0.0, 0.251, 12), (0.0, -1, 4)],
)
def test_away_by_the_velocities(linear: float, angular: float, samples: int) -> None:
    still = stood()
    for number in range(1, samples + 1):
        assert not left(still)
        moves(still, linear, angular, NOW + number * 20 * MS)
    assert left(still)


def test_there_and_back_is_not_away() -> None:
    still = stood()
    for number in range(1, 100):
        speed = 0.5 if number % 4 in (1, 2) else -0.5
        moves(still, speed, speed / 2, NOW + number * 20 * MS)
    assert not left(still)


@pytest.mark.parametrize(("linear", "angular"), [(3.0, 0.0), (0.0, 3.0), (3.0, 3.0)])
def test_a_single_velocity_is_no_motion(linear: float, angular: float) -> None:
    still = stood()
    for number in range(1, 100):
        fast = number % 3 == 0
        moves(still, linear * fast, angular * fast, NOW + number * 20 * MS)
    assert not left(still)


@pytest.mark.parametrize(("first", "second"), [(5, 0), (5, -5), (5, 0.02), (-5, -0.02), (-1, -5)])
def test_of_two_velocities_the_smaller_counts(first: float, second: float) -> None:
    still = stood()
    moves(still, first, 0.0, NOW + 20 * MS)
    moves(still, second, 0.0, NOW + 40 * MS)
    assert not left(still)
    moves(still, 0.0, first, NOW + 60 * MS)
    moves(still, 0.0, second, NOW + 80 * MS)
    assert not left(still)


@pytest.mark.parametrize(
    ("linear", "angular", "away"),
    [(0.02, 0.0, True), (0.0199, 0.05, True), (0.0199, 0.0499, False)],
)
def test_each_axis_has_a_threshold_of_its_own(linear: float, angular: float, away: bool) -> None:
    still = stood()
    for number in range(1, 400):
        moves(still, linear, angular, NOW + number * 20 * MS)
    assert left(still) is away


@pytest.mark.parametrize(("linear", "angular"), [(0.2, 0.0), (0.0, 0.2)])
@pytest.mark.parametrize(("pause_s", "away"), [(1, True), (60, False)])
def test_the_integral_of_the_velocities_leaks(
    linear: float, angular: float, pause_s: int, away: bool
) -> None:
    still, now_ns = stood(), NOW
    for samples, moving in ((10, 1), (pause_s * 50, 0), (10, 1)):
        for _ in range(samples):
            now_ns += 20 * MS
            moves(still, linear * moving, angular * moving, now_ns)
    assert left(still) is away


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("rate", "away"), [(DRIFT_RADPS, False), (3 * DRIFT_RADPS, True)])
def test_the_heading_counter_may_drift(rate: float, away: bool, sign: int) -> None:
    still = stood()
    for number in range(60):
        counts(still, 0.0, sign * rate * number, now_ns=NOW + number * NS_PER_S)
    assert left(still) is away


def test_a_drift_of_the_past_is_no_credit_for_a_turn() -> None:
    still = stood()
    for number in range(600):
        counts(still, 0.0, now_ns=NOW + number * NS_PER_S)
    counts(still, 0.0, AWAY_RAD + DRIFT_RADPS, now_ns=NOW + 600 * NS_PER_S)
    assert left(still)


def test_the_offset_of_a_sensor_is_no_motion() -> None:
    still = stood()
    for number in range(1, 10_000):
        moves(still, 0.0199, 0.0499, NOW + number * 20 * MS)
    assert not left(still)


def test_a_gap_counts_for_no_longer_than_a_velocity_holds() -> None:
    still = stood()
    moves(still, 0.2, 0.0, NOW + NS_PER_S)
    assert not left(still)
    moves(still, 0.2, 0.0, NOW + 2 * NS_PER_S)
    assert not left(still)
    moves(still, 0.2, 0.0, NOW + 3 * NS_PER_S)
    assert left(still)


def test_what_it_did_before_it_stood_does_not_count() -> None:
    still = standstill()
    still.on_lease(NOW)
    for number in range(50):
        moves(still, 1.0, 1.0, NOW + number * 20 * MS)
    moves(still, 0.0, 0.0, NOW + NS_PER_S)
    moves(still, 0.1, 0.1, NOW + NS_PER_S + 20 * MS)
    assert not left(still)


def test_a_living_lease_begins_anew() -> None:
    still = stood()
    counts(still, 0.0)
    counts(still, 1.0)
    still.on_lease(NOW)
    assert left(still)
    still.on_lease(None)
    assert not left(still)
    moves(still, 0.5, 0.0, NOW + NS_PER_S)
    counts(still, 9.0)
    counts(still, 10.0)
    assert not left(still), "safety supervises it"
    still.on_lease(NOW + 2 * NS_PER_S)
    moves(still, 0.0, 0.0, NOW + 2 * NS_PER_S)
    counts(still, 11.0)
    assert not left(still)
    counts(still, 11.0)
    counts(still, 11.1)
    assert left(still)
    counts(still, 11.0)
    assert left(still), "until the lease lives"


def test_an_end_of_a_lease_right_after_the_other_begins_anew() -> None:
    still = stood()
    counts(still, 0.0)
    counts(still, 1.0)
    still.on_lease(NOW + 1)
    assert not left(still)
