"""Measured stopping distances: compared with what safety reckons with."""

import math
from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import Mileage, Velocity
from common.motion import Twist
from services.safety.config import Safety
from services.safety.inputs import Inputs
from services.safety.report import Transition, transitions
from services.safety.stop_distance import (
    LongStop,
    StopDistance,
    stop_gauge,
    stopping_distance,
)
from tests.safety.policy_fixture import PolicyFixture

BEGIN_NS = 5 * NS_PER_S
GAUGE = stop_gauge(Safety())


def inputs_at(
    speed: float | None, at_s: float, epoch: int | None = 0, angular: float = 0.0, boot: int = 1
) -> Inputs:
    at_ns = BEGIN_NS + round(at_s * NS_PER_S)
    velocity = None if speed is None else Latest(Velocity(linear=speed, angular=angular), at_ns)
    if epoch is None:
        return Inputs(velocity=velocity)
    counters = Mileage(distance=0, heading=0, epoch=epoch, boot=boot)
    return Inputs(velocity=velocity, mileage=Latest(counters, at_ns))


def begun(speed: float = 1.0, sent: float = 1.0, **given: int | None) -> StopDistance:
    """Return the state after a STOP that was commanded at time 0."""
    inputs = inputs_at(speed, 0.0, **given)  # type: ignore[arg-type]
    return GAUGE.follow(StopDistance(), Twist(sent), False, inputs, BEGIN_NS)


def after(before: StopDistance, speeds: Sequence[float], period_s: float = 0.02) -> StopDistance:
    """Return the state after these velocities, one each 20 ms."""
    for number, speed in enumerate(speeds, 1):
        inputs = inputs_at(speed, number * period_s)
        before = GAUGE.follow(before, None, False, inputs, BEGIN_NS + round(number * 20e6))
    return before


def lasting(seconds: float, speed: float = 1.0) -> list[float]:
    """Return velocities of a vehicle that holds its speed and then stands."""
    return [speed] * round(seconds / 0.02) + [0.0, 0.0]


def test_the_reckoned_distance() -> None:
    assert stopping_distance(1.0, 0.25, 0.5) == pytest.approx(1.25)
    assert stopping_distance(0.5, 0.2, 0.5) == pytest.approx(0.35)


def test_a_long_stop_is_reported_with_its_numbers() -> None:
    # Reckoned: 0.25 + 1/1.2 = 1.083 m. Travelled: 1.20 m at full speed, then half a period.
    done = after(begun(), lasting(1.2))
    assert done.stop is None
    assert done.long is not None
    assert done.long.travel == pytest.approx(1.21)
    assert done.long.reckoned == pytest.approx(0.25 + 1 / 1.2)
    assert LongStop(0.617, 0.482).text == (
        "The last stop took 0.62 m, safety reckons with 0.48 m: run `t2 checkout stop`."
    )


@pytest.mark.parametrize(
    ("seconds", "long"), [(0.5, False), (1.08, False), (1.10, False), (1.12, True)]
)
def test_the_limit_is_the_reckoned_distance_with_the_tolerance(seconds: float, long: bool) -> None:
    """1.083 m reckoned, 0.03 m tolerance; 0.01 m for half the last period."""
    assert (after(begun(), lasting(seconds)).long is not None) is long
    assert (after(begun(-1.0, -1.0), lasting(seconds, -1.0)).long is not None) is long


def test_the_tolerance_grows_with_the_speed() -> None:
    stop = begun(0.5, 0.5).stop
    assert stop is not None
    assert stop.tolerance == pytest.approx(0.02)
    limit = stop.reckoned + stop.tolerance
    exact = replace(stop, travel=limit, standing=True, speed=0.0)
    assert after(StopDistance(exact), [0.0]).long is None
    assert after(StopDistance(replace(exact, travel=limit + 1e-6)), [0.0]).long is not None


def test_an_accelerating_vehicle_is_reckoned_at_the_commanded_speed() -> None:
    stop = begun(0.5, 1.0).stop
    assert stop is not None
    assert stop.reckoned == pytest.approx(0.25 + 1 / 1.2)
    assert stop.speed == 0.5
    faster = begun(1.0, 0.5).stop
    assert faster is not None
    assert faster.reckoned == pytest.approx(0.25 + 1 / 1.2)


def test_a_single_velocity_of_zero_is_no_standstill() -> None:
    glitch = after(begun(), [1.0, 0.0])
    assert glitch.stop is not None
    assert glitch.stop.standing
    assert after(begun(), [1.0, 0.0, 1.0, 0.0]).stop is not None
    assert after(begun(), [1.0, 0.0, 1.0, 0.0, 0.0]).stop is None
    turning = inputs_at(0.0, 0.02, angular=0.5)
    turned = GAUGE.follow(begun(), None, False, turning, BEGIN_NS + NS_PER_S // 50)
    assert turned.stop is not None
    assert not turned.stop.standing


def test_the_travel_is_integrated_once_for_each_velocity() -> None:
    once = after(begun(), [0.8])
    assert once.stop is not None
    assert once.stop.travel == pytest.approx(0.9 * 0.02)
    again = GAUGE.follow(once, None, False, inputs_at(0.8, 0.02), BEGIN_NS + NS_PER_S // 25)
    assert again is once
    older = GAUGE.follow(once, None, False, inputs_at(0.8, 0.01), BEGIN_NS + NS_PER_S // 25)
    assert older is once


@pytest.mark.parametrize(
    ("speed", "sent"), [(0.099, 0.5), (0.5, -0.5), (0.5, 0.0), (0.0, 0.5), (-0.5, 0.5)]
)
def test_no_stop_begins_slowly_or_against_the_command(speed: float, sent: float) -> None:
    assert begun(speed, sent).stop is None


def test_the_slowest_measured_stop() -> None:
    assert begun(0.1, 0.1).stop is not None
    assert begun(-0.1, -0.1).stop is not None
    assert begun(0.1, 0.0001).stop is not None


def test_no_stop_begins_without_a_velocity() -> None:
    for inputs in (inputs_at(None, 0.0), inputs_at(math.nan, 0.0), inputs_at(1.0, -0.21)):
        state = GAUGE.follow(StopDistance(), Twist(1.0), False, inputs, BEGIN_NS)
        assert state == StopDistance()
    known = GAUGE.follow(StopDistance(), Twist(1.0), False, inputs_at(1.0, -0.2), BEGIN_NS)
    assert known.stop is not None


def test_an_abandoned_stop_is_not_compared() -> None:
    moving = after(begun(), lasting(1.2)[:-1])
    assert moving.stop is not None
    at_ns = moving.stop.at_ns
    assert GAUGE.follow(moving, None, True, inputs_at(0.0, 1.24), at_ns).stop is None
    restarted = inputs_at(0.0, 1.24, epoch=1)
    assert GAUGE.follow(moving, None, False, restarted, at_ns) == StopDistance()
    rebooted = inputs_at(0.0, 1.24, boot=2)
    assert GAUGE.follow(moving, None, False, rebooted, at_ns) == StopDistance()
    for unknown in (inputs_at(None, 1.24), inputs_at(math.nan, 1.24)):
        assert GAUGE.follow(moving, None, False, unknown, at_ns) == StopDistance()


def test_a_gap_between_two_velocities() -> None:
    gap = inputs_at(1.0, 0.1)
    kept = GAUGE.follow(begun(), None, False, gap, BEGIN_NS + NS_PER_S // 10)
    assert kept.stop is not None
    assert kept.stop.travel == pytest.approx(0.1)
    gap = inputs_at(1.0, 0.101)
    assert GAUGE.follow(begun(), None, False, gap, BEGIN_NS + NS_PER_S // 9).stop is None


def test_a_stop_without_counters_is_measured() -> None:
    state = begun(epoch=None)
    inputs = inputs_at(1.0, 0.02, epoch=None)
    assert GAUGE.follow(state, None, False, inputs, BEGIN_NS + NS_PER_S // 50).stop is not None


def test_nothing_is_measured_while_driving_or_standing() -> None:
    still = StopDistance(long=LongStop(0.6, 0.5))
    inputs = inputs_at(0.5, 0.0)
    assert GAUGE.follow(still, Twist(0.5), True, inputs, BEGIN_NS) is still
    assert GAUGE.follow(still, None, True, inputs, BEGIN_NS) is still
    assert GAUGE.follow(still, None, False, inputs, BEGIN_NS) is still  # pushed by hand


def test_a_long_stop_is_kept_through_the_next_stop() -> None:
    long = LongStop(0.6, 0.5)
    inputs = inputs_at(1.0, 0.0)
    state = GAUGE.follow(StopDistance(long=long), Twist(1.0), False, inputs, BEGIN_NS)
    assert state.stop is not None
    assert after(state, lasting(0.5)) == StopDistance(long=long)
    assert GAUGE.follow(state, None, True, inputs, BEGIN_NS) == StopDistance(long=long)


def coasting(fixture: PolicyFixture, deceleration: float) -> list[Transition]:
    """Slow the vehicle down at this rate; return safety's events without those of causes."""
    found = []
    assert fixture.linear is not None
    while True:
        before = fixture.state
        fixture.linear = max(0.0, fixture.linear - deceleration * 0.02)
        fixture.tick()
        for each in transitions(before, fixture.state, None):
            if each.name == "long_stop":
                found.append(each)
        if fixture.linear == 0 and fixture.state.stop_distance.stop is None:
            return found


@pytest.mark.parametrize(("deceleration", "events"), [(0.4, 1), (0.6, 0)])
def test_the_policy_measures_the_stops_that_it_commands(deceleration: float, events: int) -> None:
    fixture = PolicyFixture().ready()
    fixture.drive(0.8, seconds=2.5)
    fixture.linear = 0.8
    fixture.drive(0.8)
    assert fixture.state.stop_distance == StopDistance()
    fixture.tick(30)  # without requests
    assert fixture.state.stop_distance.stop is not None
    found = coasting(fixture, deceleration)
    assert len(found) == events
    assert all(each.level == "warning" and "took" in each.text for each in found)


def test_slowing_down_on_request_is_not_measured() -> None:
    fixture = PolicyFixture().ready()
    fixture.drive(0.8, seconds=2.5)
    fixture.drive(0.0, seconds=2.5)
    fixture.tick(30)
    assert fixture.state.stop_distance == StopDistance()
