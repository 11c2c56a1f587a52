"""Standstill supervision: exact bounds, and measurements that are looked at once."""

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import Mileage
from common.motion import AWAY_M, AWAY_RAD, STANDING_MPS, STANDING_RADPS, STILL, Twist
from services.safety.config import Safety
from services.safety.standstill import (
    CONFIRM_NS,
    FASTEST_MPS,
    GRACE_NS,
    LONGEST_STOP_NS,
    Measured,
    Phase,
    supervisor,
)
from tests.safety.standstill_fixture import SUPERVISOR, TICK_NS, Board, standing


@pytest.mark.parametrize(("linear", "angular"), [(AWAY_M, 0.0), (0.0, AWAY_RAD)])
def test_a_vehicle_exactly_at_the_bound_has_stayed(linear: float, angular: float) -> None:
    board = standing()
    board.state = replace(board.state, counted=Twist(linear, 0.0), integrated=Twist(0.0, angular))
    board.counts = False
    assert not board.step(None).left


def test_standstill_is_confirmed_after_exactly_its_time() -> None:
    board = Board()
    board.step()
    for _ in range(CONFIRM_NS // TICK_NS):
        assert board.state.phase is Phase.STOPPING
        board.step()
    assert board.state.phase is Phase.STANDING


def test_a_vehicle_that_left_has_to_stand_for_the_whole_time_again() -> None:
    board = standing()
    board.distance = 0.05
    board.step()
    board.distance = 0.1
    assert board.step().left
    board.step()  # its velocity was zero all the time
    assert board.state.phase is Phase.STOPPING


def test_a_step_of_the_counters_as_fast_as_the_fastest_vehicle_counts() -> None:
    board = standing()
    board.now_ns += NS_PER_S - TICK_NS
    board.distance = FASTEST_MPS
    assert board.step().left


def test_the_time_between_counters_is_a_difference() -> None:
    board = standing()
    board.mono_ns = 5 * NS_PER_S
    board.step()
    board.distance = 0.6  # implausible within a tick
    assert not board.step().left


def test_only_velocities_from_the_standstill_threshold_on_are_integrated() -> None:
    board = standing()
    for _ in range(2):
        board.step(STANDING_MPS * 0.99, STANDING_RADPS * 0.99)
    assert board.state.integrated == STILL
    for _ in range(2):
        board.step(STANDING_MPS, STANDING_RADPS)
    way = (board.state.integrated.linear, board.state.integrated.angular)
    tick_s = TICK_NS / NS_PER_S
    assert way == pytest.approx((STANDING_MPS * tick_s, STANDING_RADPS * tick_s), rel=0.05)


def test_velocities_of_opposite_sign_have_nothing_in_common() -> None:
    board = standing()
    for linear in (0.5, -0.5, 0.5, -0.5):
        board.step(linear)
        assert board.state.velocities.steady == STILL


def test_the_first_known_velocity_shortens_the_time_limit_at_once() -> None:
    board = Board()
    board.step(1.0, commanded=False)
    board.step(None)  # now the highest speed is assumed
    began_ns = board.now_ns
    assert board.state.due_ns == began_ns + round(NS_PER_S / 0.6) + GRACE_NS
    board.step(0.3)
    assert board.state.due_ns == board.now_ns + NS_PER_S // 2 + GRACE_NS
    due_ns = board.state.due_ns
    board.step(0.0)
    assert board.state.due_ns == due_ns < began_ns + LONGEST_STOP_NS


def test_the_fastest_velocity_is_that_of_the_settings() -> None:
    assert supervisor(Safety(max_linear=0.7, max_angular=0.4)).fastest == Twist(0.7, 0.4)


# --- a motion that goes on ------------------------------------------------------------------


def measured(now_ns: int) -> Measured:
    """Return new measurements."""
    counters = Mileage(distance=1.0, heading=0.0, epoch=0)
    return Measured(Latest(Twist(0.3, 0.0), now_ns), Latest(counters, now_ns))


def test_a_motion_without_a_new_measurement_changes_nothing() -> None:
    seen = measured(NS_PER_S)
    moving = SUPERVISOR.follow(standing().state, False, seen, NS_PER_S)
    assert SUPERVISOR.follow(moving, False, seen, 2 * NS_PER_S) is moving


def test_a_new_measurement_is_looked_at_during_a_motion() -> None:
    first, second = measured(NS_PER_S), measured(2 * NS_PER_S)
    moving = SUPERVISOR.follow(standing().state, False, first, NS_PER_S)
    velocity = Measured(second.velocity, first.counters)
    after = SUPERVISOR.follow(moving, False, velocity, 2 * NS_PER_S)
    assert after.velocities.received_ns == 2 * NS_PER_S
    counters = Measured(first.velocity, second.counters)
    after = SUPERVISOR.follow(moving, False, counters, 2 * NS_PER_S)
    assert after.counters is second.counters
    after = SUPERVISOR.follow(moving, False, Measured(None, first.counters), 2 * NS_PER_S)
    assert after.velocities.newest is None


def test_a_motion_begins_and_ends_without_a_new_measurement() -> None:
    seen = measured(NS_PER_S)
    still = SUPERVISOR.follow(standing().state, True, seen, NS_PER_S)
    moving = SUPERVISOR.follow(still, False, seen, 2 * NS_PER_S)
    assert moving.phase is Phase.MOVING
    assert SUPERVISOR.follow(moving, True, seen, 3 * NS_PER_S).phase is Phase.STOPPING
