"""Proposals from synthetic stops: bounds on the safe side, and what is missing."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from cli.fit.estimate import Estimate
from cli.fit.fit import Fit, fit, needed, reckoned, refusal
from cli.fit.streams import Streams
from cli.settings import Everything, safety_config
from t2.messages import Command
from tests.cli.fit.stops_fixture import streams
from tests.cli.fit.test_steady import drive

SPEEDS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9)
TODAY = Everything()


def measured(
    speeds: tuple[float, ...] = SPEEDS, settings: Everything = TODAY, **decelerations: float
) -> Fit:
    """Return the fit of stops in each direction from these speeds."""
    made = Streams()
    begin_s = 10.0
    for direction, sign, turns in (
        ("forward", 1, False), ("backward", -1, False), ("left", 1, True), ("right", -1, True),
    ):  # fmt: skip
        deceleration = decelerations.get(direction, 0.5)
        for speed in speeds:
            one = streams(
                sign=sign, speed=speed, begin_s=begin_s, turns=turns, deceleration=deceleration,
                until_s=1.0 + speed / deceleration,
            )  # fmt: skip
            made.motions += one.motions
            made.velocities += one.velocities
            made.mileages += one.mileages
            begin_s += 10.0
    made.sort()
    return fit([made], settings)


def test_the_worst_direction_is_proposed() -> None:
    found = measured(forward=0.5, backward=0.4, left=0.9, right=0.7)
    assert found.missing == []
    assert found.proposals["vehicle.deceleration"] == pytest.approx(0.39, abs=0.011)
    assert found.proposals["vehicle.angular_deceleration"] == pytest.approx(0.69, abs=0.021)
    assert 0.2 <= float(found.proposals["safety.react"]) <= 0.25


def test_with_the_proposal_safety_reckons_with_each_stop() -> None:
    found = measured(forward=0.3, backward=0.5, left=0.5, right=0.3)
    assert len(found.too_long) > 10
    worst = found.too_long[0]
    assert reckoned(worst, safety_config(TODAY)) < needed(worst)
    react = float(found.proposals["safety.react"])
    linear = float(found.proposals["vehicle.deceleration"])
    angular = float(found.proposals["vehicle.angular_deceleration"])
    vehicle = replace(TODAY.vehicle, deceleration=linear, angular_deceleration=angular)
    safety = replace(TODAY.safety, react=react)
    proposed = replace(TODAY, vehicle=vehicle, safety=safety)
    assert fit(found.streams, proposed).too_long == []


@pytest.mark.parametrize(
    ("speeds", "missing"),
    [
        (SPEEDS[:5], "1 more of STOP forward from 0.40 m/s or more"),
        ((0.5, 0.5, 0.5, 0.6, 0.69), "a STOP forward from 0.70 m/s or more: the fastest is from "
         "0.69 of the 1 that are allowed"),
        ((0.5, 0.5, 0.5, 0.6, 0.71), ""),
    ],
)  # fmt: skip
def test_what_is_missing(speeds: tuple[float, ...], missing: str) -> None:
    found = measured(speeds)
    assert found.missing[:1] == ([missing] if missing else [])
    assert bool(found.proposals) is not bool(missing)


def test_no_proposal_takes_a_protection_away() -> None:
    """The vehicle brakes better than the settings may say, or worse than they can."""
    strong = measured(forward=1.9, backward=1.9, left=5.0, right=5.0)
    body = TODAY.vehicle
    assert strong.proposals["vehicle.deceleration"] == body.deceleration
    assert strong.proposals["vehicle.angular_deceleration"] == body.angular_deceleration
    assert "set vehicle.deceleration, and repeat the slow-downs" in strong.hints[0]
    weak = measured(left=0.09)
    assert "vehicle.angular_deceleration" not in weak.proposals
    assert any("the bound of a deceleration is too low" in each for each in weak.missing)


def changed(change: Callable[[Streams], None]) -> Fit:
    """Return the fit of stops that safety reckons with, after a change of their streams."""
    (made,) = measured(forward=0.7, backward=0.7, left=1.2, right=1.2).streams
    change(made)
    return fit([made], TODAY)


def faster(made: Streams) -> None:
    made.velocities = [replace(v, linear=1.4 * v.linear) for v in made.velocities]


def disobeyed(made: Streams) -> None:
    made.motions = [replace(m, angular=m.angular / 1.4) for m in made.motions]


def rolling(made: Streams) -> None:
    """The newest stop to the right does nothing until BRAKE."""
    begin_ns = made.motions[-1].mono_ns
    made.motions.append(replace(made.motions[-1], command=Command.BRAKE, seq=3,
                                mono_ns=begin_ns + 500_000_000))  # fmt: skip
    made.velocities = [
        replace(v, angular=-0.9) if 0 < v.mono_ns - begin_ns < 700_000_000 else v
        for v in made.velocities
    ]


@pytest.mark.parametrize(
    ("change", "doubt"),
    [
        (faster, "velocities and counters that agree: driving to standstill 1.4"),
        (disobeyed, "a vehicle that obeys: turning it was 1.40 times as fast as commanded"),
        (rolling, "a steady STOP right: the one from 0.90 rad/s that needed "),
    ],
)
def test_what_contradicts_the_stops_leaves_nothing_to_propose(
    change: Callable[[Streams], None], doubt: str
) -> None:
    found = changed(change)
    assert found.proposals == {}
    assert any(each.startswith(doubt) for each in found.missing), found.missing
    assert changed(lambda _: None).missing == []


def test_a_stop_without_its_begin_is_too_long_or_shows_nothing() -> None:
    (made,) = measured(forward=0.7, backward=0.7, left=1.2, right=0.5).streams
    long = len(fit([made], TODAY).too_long)
    assert long > 0
    made.motions[-1] = replace(made.motions[-1], seq=9)
    found = fit([made], TODAY)
    assert found.missing == ["1 more of STOP right from 0.40 rad/s or more"]
    assert len(found.too_long) == long


def test_counters_that_the_ground_contradicts_leave_nothing_to_propose() -> None:
    (made,) = measured().streams
    for ratio, proposes in ((0.5, False), (1.01, True)):
        truth = Estimate(name="distance, counted / driven", unit="", values=(ratio,))
        assert bool(fit([made], TODAY, [truth]).proposals) is proposes


def test_stops_in_curves_alone_are_not_enough() -> None:
    (made,) = measured().streams
    made.velocities = [
        replace(v, linear=v.linear or v.angular, angular=v.angular or v.linear)
        for v in made.velocities
    ]
    found = fit([made], TODAY)
    assert found.proposals == {}
    assert len(found.missing) >= 4


def test_proposals_with_which_safety_would_not_start_say_so() -> None:
    """The sonars see 1 m, and the vehicle stops within more than that."""
    found = measured(forward=0.3)
    assert refusal(found) == ""
    found.proposals["vehicle.sonar_max"] = 1.0
    assert refusal(found).startswith("sonar_max 1 m is too near: from max_linear 1 m/s")


@pytest.mark.parametrize(
    ("counted", "turned", "path", "unit"),
    [
        (0.573, 5, "wire.command_angular_unit", "milliradian"),
        (0.573, 4, "wire.command_angular_unit", None),  # a single one may have slipped
        (1.0, 5, "wire.command_angular_unit", None),
        (1.2, 5, "wire.command_angular_unit", None),
        (0.573, 5, "wire.feedback_angular_unit", None),
        (1.745, 5, "wire.feedback_angular_unit", "milliradian"),
    ],
)
def test_units(counted: float, turned: int, path: str, unit: str | None) -> None:
    """The counters show the firmware's unit; the measured velocity agrees with the command."""
    turns = [part for n in range(turned) for part in ((1.0, 0, 0), (2.0, 0, 0.5 * (-1) ** n))]
    made = drive(*turns, scale=counted)
    if path.startswith("wire.feedback"):
        made.mileages = drive(*turns).mileages
        made.velocities = [replace(v, angular=v.angular * counted) for v in made.velocities]
    assert fit([made], TODAY).proposals.get(path) == unit
