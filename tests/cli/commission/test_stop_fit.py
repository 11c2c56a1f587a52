"""Fit of measured stops, and the settings proposed for them."""

import math
from collections.abc import Sequence
from statistics import NormalDist, mean

import pytest

from cli.commission.stop_fit import (
    Settings,
    estimate,
    fits,
    label,
    missing,
    present_settings,
    propose,
    shortfall,
    student,
    too_long,
)
from cli.commission.stops import Stop, find_stops
from common.motion import Command
from services.safety.config import Safety
from services.safety.core.release import stopping_distance
from tests.cli.commission.stops_fixture import SPEEDS, StopMaker, stop, stops


@pytest.mark.parametrize(
    ("confidence", "freedom", "quantile"),
    [
        (0.975, 4, 2.7764), (0.975, 5, 2.5706), (0.975, 9, 2.2622), (0.975, 30, 2.0423),
        (0.975, 49, 2.0096), (0.95, 4, 2.1318), (0.95, 20, 1.7247), (0.975, 1000, 1.9623),
        (0.9875, 4, 3.4954), (0.9875, 5, 3.1634), (0.9875, 9, 2.6850),
    ],
)  # fmt: skip
def test_quantiles_as_in_the_tables(confidence: float, freedom: int, quantile: float) -> None:
    assert student(confidence, freedom) == pytest.approx(quantile, rel=2e-3)


def test_each_term_of_the_expansion() -> None:
    """At z = 2 with one degree of freedom, worked out by hand."""
    terms = 10 / 4 + 294 / 96 + 1098 / 384 + 169950 / 92160
    assert student(NormalDist().cdf(2.0), 1) == pytest.approx(2.0 + terms, rel=1e-12)


def test_the_bounds_of_the_mean_and_of_the_next_value() -> None:
    """Five values with the standard deviation sqrt(2.5), t by the table."""
    one = estimate([1.0, 2.0, 3.0, 4.0, 5.0], 0.5)
    assert one.mean == 3.0
    assert one.high == pytest.approx(3 + 3.4954 * math.sqrt(2.5 / 5) + 0.5, rel=2e-3)
    assert one.low == pytest.approx(6 - one.high)
    assert one.next_high == pytest.approx(3 + 2.7764 * math.sqrt(2.5 * 1.2) + 0.5, rel=2e-3)
    assert one.next_low == pytest.approx(6 - one.next_high)


def test_a_brake_within_a_period_has_a_bound_too() -> None:
    maker = StopMaker(3)
    for speed in SPEEDS:
        maker.stop(speed, Command.BRAKE)
    found, _ = find_stops(maker.streams)
    fit = fits(found, maker.streams.period_s)["brake", "forward"]
    assert 5 < fit.deceleration.next_low < fit.deceleration.low < fit.deceleration.mean
    assert fit.deceleration.next_high == 1000.0


def test_the_groups() -> None:
    found = fits([*stops(), stop(0.5, kind="brake")], 0.02)
    assert list(found) == [("stop", "forward"), ("stop", "backward")]
    fit = found["stop", "forward"]
    assert (fit.stops, fit.slowest, fit.fastest) == (5, 0.3, 1.0)
    assert fit.reaction.mean == pytest.approx(0.1016)
    assert fit.deceleration.mean == pytest.approx(1 / mean((1 / 0.8, 1 / 0.81) * 2 + (1 / 0.8,)))
    assert label(("brake", "backward")) == "BRAKE backward"


def test_the_resolution_widens_the_bounds() -> None:
    """A period of the velocities; a step of 1 mm/s over the slope of the slowest stop."""
    same = [stop(speed) for speed in (0.25, 0.5, 0.6, 0.8, 1.0)]
    fit = fits(same, 0.02)["stop", "forward"]
    assert fit.reaction.low == pytest.approx(0.08)
    assert fit.reaction.high == fit.reaction.next_high == pytest.approx(0.12)
    assert 1 / fit.deceleration.low == pytest.approx(1 / 0.8 + 0.001 / (0.8 * 0.25))
    assert 1 / fit.deceleration.high == pytest.approx(1 / 0.8 - 0.001 / (0.8 * 0.25))


def test_what_is_missing() -> None:
    assert list(missing(stops(), 1.0)) == []
    assert list(missing([], 1.0)) == ["5 more STOP forward", "5 more STOP backward"]
    four = [one for one in stops() if one.direction == "forward" or one.speed < 1.0]
    assert list(missing(four, 1.0)) == ["1 more STOP backward"]
    assert list(missing([*stops(), stop(0.5, kind="brake")], 1.0)) == []


def test_the_speeds_that_are_missing() -> None:
    slow = stops([0.3, 0.4, 0.5, 0.7, 0.79])
    assert list(missing(slow, 1.0)) == [
        f"STOP {direction} from at least 0.80 m/s (the fastest is 0.79 m/s), "
        "or a lower safety.max_linear"
        for direction in ("forward", "backward")
    ]
    assert list(missing(slow, 0.9875)) == []
    narrow = stops([0.51, 0.6, 0.7, 0.8, 1.0])
    assert list(missing(narrow, 1.0)) == [
        f"STOP {direction} from at most 0.50 m/s" for direction in ("forward", "backward")
    ]
    assert list(missing(stops([0.5, 0.6, 0.7, 0.8, 1.0]), 1.0)) == []
    brakes = [stop(speed, kind="brake") for speed in (0.1, 0.2, 0.3, 0.4, 0.5)]
    assert "BRAKE forward from at least" in next(missing([*stops(), *brakes], 1.0))
    one = stop(0.5, kind="brake", direction="backward")
    (text,) = missing([one, *stops([0.3, 0.5, 0.7, 0.9, 1.2]), *brakes], 1.2)
    assert text.startswith("BRAKE forward from at least 0.96 m/s (the fastest is 0.50 m/s)")


def proposed(found: Sequence[Stop], margin: float = 0.2) -> Settings:
    settings = propose(fits(found, 0.02), found, margin, 0.1)
    assert isinstance(settings, Settings)
    return settings


def test_the_proposal_is_rounded_to_the_safe_side() -> None:
    found = stops()
    fit = fits(found, 0.02)["stop", "forward"]
    one = proposed(found)
    assert 0 <= one.react - (fit.reaction.next_high + 0.1) < 0.01
    assert 0 <= fit.deceleration.next_low - one.deceleration < 0.01
    assert one.react == round(one.react, 2)
    assert one.deceleration == round(one.deceleration, 2)
    assert one.margin == 0.2


def test_the_worst_group_counts() -> None:
    """BRAKE with enough stops too."""
    alone = proposed(stops())
    weak = [stop(speed, 0.3, 0.5, kind="brake") for speed in SPEEDS]
    both = proposed([*stops(), *weak])
    assert both.react == pytest.approx(0.42)
    assert both.deceleration == 0.49
    assert alone.react < 0.3
    assert alone.deceleration > 0.7


def test_an_exact_value_is_not_rounded() -> None:
    same = [stop(speed, 0.13, 0.5, distance=0.0) for speed in SPEEDS]
    assert proposed(same).react == 0.25


def test_the_limits_of_the_settings() -> None:
    fast = proposed([stop(speed, 0.0, 4.0) for speed in SPEEDS])
    assert fast.deceleration == 1.0
    assert proposed([stop(speed, -0.05, 4.0) for speed in SPEEDS]).react == 0.1
    slow = [stop(speed, 0.1, 0.08) for speed in SPEEDS]
    refused = propose(fits(slow, 0.02), slow, 0.2, 0.1)
    assert isinstance(refused, str)
    assert refused.startswith("the next stop may decelerate with 0.08 m/s2 only")
    enough = proposed([stop(speed, 0.1, 0.102) for speed in SPEEDS])
    assert enough.deceleration == 0.1


def test_the_margin_covers_every_recorded_stop() -> None:
    found = [*stops(), stop(0.5, distance=0.9)]
    one = proposed(found)
    for each in found:
        assert each.distance <= one.room(each.speed)
    reckoned = 0.5 * one.react + 0.125 / one.deceleration
    assert 0 <= one.margin - (0.2 + 0.9 - reckoned) < 0.01
    assert proposed(stops(), 0.3).margin == 0.3


def test_room_is_what_safety_keeps() -> None:
    assert Settings(0.25, 0.5, 0.2).room(1.0) == pytest.approx(1.45)


def test_stops_that_were_too_long() -> None:
    present = present_settings(Safety())
    reckoned = 0.5 * 0.25 + 0.25 / 1.2
    exact = stopping_distance(0.5, 0.25, 0.6)
    assert too_long([stop(0.5, distance=exact)], present) == []
    found = [stop(0.5, distance=reckoned - 1e-9), stop(0.5, distance=reckoned + 1e-9), stop(0.3)]
    assert too_long(found, present) == [1]


def test_the_largest_shortfall() -> None:
    present = present_settings(Safety())
    assert present == Settings(0.25, 0.6, 0.2)
    assert shortfall(present, present, 1.0)[1] == 0.0
    speed, room = shortfall(present, Settings(0.35, 0.6, 0.2), 1.0)
    assert speed == 1.0
    assert room == pytest.approx(0.1)
    speed, room = shortfall(present, Settings(0.3, 1.0, 0.2), 1.0)
    assert speed == 0.1
    assert room == pytest.approx(0.05 * 0.1 - 0.01 / 2 * (1 / 0.6 - 1))
    assert shortfall(present, Settings(0.2, 0.7, 0.2), 1.0)[1] < 0
    assert shortfall(present, Settings(0.35, 0.6, 0.2), 0.5)[0] == 0.5
