"""The parts of a few lines: twist, ramp, heartbeat, runaway, flapping."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S, Latest
from common.heartbeat import CAPACITY, Heartbeat
from common.messages import Mileage, Velocity
from common.motion import STILL, Twist
from services.safety.fault_budget import FAILURES, FaultBudget
from services.safety.inputs import Inputs
from services.safety.ramp import ramp, start
from services.safety.runaway import Axis, Bounds
from services.safety.trajectory import Counter

UP, DOWN = Twist(0.5, 1.5), Twist(0.6, 1.0)
BOUNDS = Bounds(deceleration=0.6, tolerance=0.3, against=0.1, patience_s=0.3)
speeds = st.floats(-2.0, 2.0)


@pytest.mark.parametrize(
    ("linear", "angular", "standing"),
    [(0.019, 0.049, True), (0.02, 0.0, False), (0.0, -0.05, False), (math.nan, 0.0, False)],
)
def test_standing(linear: float, angular: float, standing: bool) -> None:
    assert Twist(linear, angular).is_standing == standing


@given(speeds, speeds)
def test_a_twist_within_limits_keeps_its_curve(linear: float, angular: float) -> None:
    twist = Twist(linear, angular)
    inside = twist.within(1.0, 0.5)
    assert abs(inside.linear) <= 1.0 + 1e-9
    assert abs(inside.angular) <= 0.5 + 1e-9
    assert inside.linear * angular == pytest.approx(inside.angular * linear)
    if abs(linear) <= 1.0 and abs(angular) <= 0.5:
        assert inside == twist


@pytest.mark.parametrize(
    ("current", "target", "after"),
    [
        (0.0, 1.0, 0.05),
        (0.98, 1.0, 1.0),
        (1.0, 0.0, 0.94),
        (0.5, -1.0, 0.44),
        (0.03, -1.0, 0.0),
        (0.0, -1.0, -0.05),
        (-1.0, 0.0, -0.94),
    ],
)
def test_a_ramp_step(current: float, target: float, after: float) -> None:
    assert ramp(Twist(current), Twist(target), UP, DOWN, 0.1).linear == pytest.approx(after)


def test_turning_has_a_ramp_of_its_own() -> None:
    after = ramp(STILL, Twist(1.0, 1.0), UP, DOWN, 0.1)
    assert (after.linear, after.angular) == pytest.approx((0.05, 0.15))


@given(speeds, speeds, st.floats(0.0, 0.1))
def test_a_ramp_never_overshoots(current: float, target: float, dt_s: float) -> None:
    after = ramp(Twist(current), Twist(target), UP, DOWN, dt_s).linear
    assert min(current, target) - 1e-12 <= after <= max(current, target) + 1e-12


@pytest.mark.parametrize(
    ("measured", "target", "begin"),
    [(0.5, 1.0, 0.5), (1.0, 0.5, 0.5), (-0.5, 1.0, 0.0), (0.5, 0.0, 0.0), (-0.5, -1.0, -0.5)],
)
def test_a_ramp_begins_with_what_is_wanted_of_the_motion(
    measured: float, target: float, begin: float
) -> None:
    assert start(Twist(measured, measured), Twist(target, target)) == Twist(begin, begin)


def test_heartbeats_rise_and_are_forgotten_in_the_end() -> None:
    beat = Heartbeat(1000)
    assert beat.is_late(1000, 0, 10)
    for now_ns in range(CAPACITY + 5):
        beat = beat.beat(now_ns)
    assert beat.number == 1000 + CAPACITY + 5
    assert len(beat.sent) == CAPACITY
    assert not beat.is_late(beat.number, CAPACITY + 4 + 10, 10)
    assert beat.is_late(beat.number, CAPACITY + 4 + 11, 10)
    assert beat.is_late(1001, 0, 10**9)


def follow(axis: Axis, commanded: float, measured: float, seconds: float) -> Axis:
    for _ in range(round(seconds / 0.02)):
        axis = axis.follow(commanded, measured, 0.02, BOUNDS)
    return axis


@pytest.mark.parametrize(
    ("commanded", "measured", "bad"),
    [
        (0.5, 0.5, False),
        (0.5, 0.8, False),
        (0.5, 0.81, True),
        (-0.5, -0.81, True),
        (-0.5, -0.79, False),
        (0.5, 0.0, False),
        (0.5, -0.1, False),
        (0.5, -0.11, True),
        (-0.5, 0.11, True),
        (-0.5, 0.1, False),
        (0.0, 0.3, False),
        (0.0, 0.31, True),
        (0.0, -0.31, True),
    ],
)
def test_what_counts_as_running_away(commanded: float, measured: float, bad: bool) -> None:
    assert (follow(Axis(), commanded, measured, 0.28).bad_s > 0.27) == bad


def test_slowing_down_as_it_must_is_no_runaway() -> None:
    axis = follow(Axis(), 1.0, 1.0, 1.0)
    for step in range(100):
        late_s = max(0.0, step * 0.02 - 0.25)
        axis = axis.follow(0.0, max(0.0, 1.0 - 0.6 * late_s), 0.02, BOUNDS)
        assert axis.bad_s == 0


def test_bad_time_is_forgiven_half_as_fast_and_never_piles_up() -> None:
    axis = follow(Axis(), 0.0, 1.0, 9.0)
    assert axis.bad_s == BOUNDS.patience_s
    assert follow(axis, 0.0, 0.0, 0.2).bad_s == pytest.approx(0.2)
    axis = Axis()
    for _ in range(20):  # flapping
        axis = follow(follow(axis, 0.0, 1.0, 0.04), 0.0, 0.0, 0.04)
    assert axis.bad_s > 0.27


def test_credit_drains_faster_than_it_refills() -> None:
    credit = FaultBudget()
    for n in range(int(FAILURES)):
        assert not credit.is_spent
        credit = credit.after((n + 1) * NS_PER_S, failed=True, good=False)
    assert credit.is_spent
    assert credit.after(99 * NS_PER_S, failed=False, good=False).is_spent
    assert credit.after(6 * NS_PER_S, failed=False, good=True).left == pytest.approx(0.1)
    assert FaultBudget().after(99 * NS_PER_S, failed=False, good=True).left == FAILURES


def test_a_velocity_is_unknown_until_it_is_a_number() -> None:
    assert Inputs().measured is None
    for linear, known in ((math.nan, None), (0.5, Twist(0.5, 0.0))):
        velocity = Latest(Velocity(linear=linear, angular=0.0), 0)
        assert Inputs(velocity=velocity).measured == known


@pytest.mark.parametrize(
    ("distance", "heading", "known"),
    [(1.0, 2.0, True), (math.nan, 0.0, False), (0.0, math.inf, False), (-math.inf, 0.0, False)],
)
def test_counters_are_unknown_until_they_are_numbers(
    distance: float, heading: float, known: bool
) -> None:
    assert Inputs().counter is None
    mileage = Mileage(distance=distance, heading=heading, epoch=3, boot=9)
    counter = Inputs(mileage=Latest(mileage, 0)).counter
    assert counter == (Counter((9, 3), distance, heading) if known else None)
