"""Time to stop: how long a vehicle may take to stand after a STOP."""

import pytest

from common.freshness import NS_PER_S
from common.motion import Twist
from services.safety.standstill import Phase, Standstill, Supervisor, Velocities
from tests.safety.policy_fixture import TICK_S
from tests.safety.standstill_fixture import TICK_NS, Board


@pytest.mark.parametrize(
    ("linear", "angular", "due_s"),
    [
        (0.28, 0.0, 0.28 / 0.6 + 0.5),
        (0.0, 0.49, 0.49 / 1.0 + 0.5),
        (-0.28, 0.0, 0.28 / 0.6 + 0.5),
        (0.6, -0.1, 1.5),  # a curve: both axes slow down together
        (0.06, -0.9, 1.4),
    ],
)
def test_it_stands_within_the_time_that_its_speed_takes(
    linear: float, angular: float, due_s: float
) -> None:
    board = Board()
    board.step(linear, angular, commanded=False)
    assert board.state.phase is Phase.MOVING
    began_ns = board.now_ns
    while not board.late():
        board.step(linear, angular)
        assert board.now_ns < began_ns + 3 * NS_PER_S
    took_s = (board.now_ns - began_ns) / NS_PER_S
    assert due_s < took_s <= due_s + 3 * TICK_S


def test_it_is_late_from_the_first_moment_after_the_time() -> None:
    velocities = Velocities(Twist(0.1), 5, Twist(0.1))
    stopping = Standstill(Phase.STOPPING, due_ns=100, velocities=velocities)
    assert not stopping.is_late(100)
    assert stopping.is_late(101)
    assert not Standstill(Phase.STANDING, due_ns=100, velocities=velocities).is_late(101)
    assert not Standstill(Phase.STOPPING, due_ns=None, velocities=velocities).is_late(101)


def test_standing_in_time_is_not_late() -> None:
    board = Board()
    board.step(0.3, commanded=False)
    board.run(0.9, 0.3)
    board.run(0.3, 0.0)
    assert board.state.phase is Phase.STANDING
    board.run(5.0)
    assert not board.late()


def test_an_unknown_velocity_is_no_standstill_and_counts_as_the_fastest() -> None:
    board = Board()
    board.step(None, commanded=False)
    board.run(1.0 / 0.6 + 0.5 - TICK_S, None)
    assert not board.late()
    board.run(3 * TICK_S, None)
    assert board.late()
    assert board.state.text == "Standstill is not confirmed: no velocity is received."


def test_the_first_known_velocity_shortens_the_time_of_an_unknown_one() -> None:
    board = Board()
    board.step(0.3, commanded=False)
    board.step(None, commanded=False)
    board.run(0.5, None)
    began_ns = board.now_ns
    while not board.late():
        board.step(0.12)
    took_s = (board.now_ns - began_ns) / NS_PER_S
    assert 0.12 / 0.6 + 0.5 < took_s <= 0.12 / 0.6 + 0.5 + 3 * TICK_S


def test_a_later_gap_does_not_extend_the_time() -> None:
    board = Board()
    board.step(0.12, commanded=False)
    board.run(0.5, 0.12)
    board.run(0.1, None)
    board.run(0.2, 0.12)
    assert board.late()


def dither(board: Board, run_s: float, seconds: float, linear: float | None = 0.3) -> float | None:
    """Alternate short motions and 0.4 s of standstill commanded; return when it is late."""
    began_ns = board.now_ns
    while board.now_ns - began_ns < seconds * NS_PER_S:
        for _ in range(round(run_s / TICK_S)):
            board.step(linear, commanded=False)
        for _ in range(20):
            board.step(linear)
            if board.late():
                return (board.now_ns - began_ns) / NS_PER_S
    return None


@pytest.mark.parametrize("linear", [0.3, None])
def test_short_motions_do_not_renew_the_time_to_stop(linear: float | None) -> None:
    board = Board()
    board.step(0.3, commanded=False)
    board.run(0.1, 0.3)
    late_s = dither(board, 0.04, 60.0, linear)
    assert late_s is not None
    assert late_s < 1.2


def test_short_motions_before_the_first_velocity_do_not_make_it_late() -> None:
    board = Board()
    assert dither(board, 0.04, 2.0, None) is None


def test_the_time_of_a_short_motion_is_added_to_the_time_to_stop() -> None:
    board = Board()
    board.step(0.3, commanded=False)
    board.step(0.3)
    due_ns = board.state.due_ns
    assert due_ns is not None
    for _ in range(5):
        board.step(0.3, commanded=False)
        assert not board.late()
    assert board.step(0.3).due_ns == due_ns + 5 * TICK_NS


@pytest.mark.parametrize(("ticks", "renewed"), [(24, False), (25, True)])
def test_a_motion_of_half_a_second_has_its_own_time_to_stop(ticks: int, renewed: bool) -> None:
    board = Board()
    board.step(0.3, commanded=False)
    due_ns = board.step(0.3).due_ns
    assert due_ns is not None
    for _ in range(ticks):
        board.step(0.9, commanded=False)
    after_ns = board.step(0.9).due_ns
    assert after_ns is not None
    assert (after_ns - board.now_ns == round(0.9 / 0.6 * NS_PER_S) + NS_PER_S // 2) == renewed
    assert (after_ns == due_ns + ticks * TICK_NS) != renewed


def test_a_vehicle_that_stood_has_a_new_time_to_stop() -> None:
    board = Board()
    board.step(0.3, commanded=False)
    board.run(0.1, 0.3)
    board.step(0.0, commanded=False)
    board.step(0.0, commanded=False)
    board.step(0.3, commanded=False)
    assert board.state.due_ns is None
    assert board.step(0.3).due_ns == board.now_ns + NS_PER_S


@pytest.mark.parametrize("slow", [Supervisor(0.1, 1.0, Twist(1.0)), Supervisor(1.0, 0.1, Twist())])
def test_the_time_to_stop_is_at_most_3_s(slow: Supervisor) -> None:
    board = Board()
    board.supervisor = slow
    board.step(1.0, 1.0, commanded=False)
    board.run(3.0, 1.0, 1.0)
    assert not board.late()
    board.run(2 * TICK_S, 1.0, 1.0)
    assert board.late()


def test_at_start_the_time_counts_from_the_first_velocity() -> None:
    board = Board()
    board.run(60.0, None)
    assert not board.late()
    board.run(0.3 / 0.6 + 0.5 - TICK_S, 0.3)
    assert not board.late()
    board.run(4 * TICK_S, 0.3)
    assert board.late()
    assert board.state.text == "The vehicle does not stop: 0.30 m/s, 0.00 rad/s."


def test_a_single_velocity_does_not_begin_or_end_a_standstill() -> None:
    board = Board()
    board.step(0.3, commanded=False)
    board.run(0.9, 0.3)
    board.step(0.0)
    board.step(0.3)
    board.run(0.3, 0.3)
    assert board.late()
    board.run(0.1, 0.0)
    board.step(0.3)
    board.run(0.12, 0.0)
    assert board.state.phase is Phase.STANDING


def test_passing_through_zero_is_no_standstill_yet() -> None:
    board = Board()
    board.step(0.4, commanded=False)
    board.run(0.1, 0.4)
    board.run(0.1, 0.0)
    board.run(0.3, -0.1)  # the rebound of a contact
    assert board.state.still_ns is None
    board.run(0.3, 0.0)
    assert board.state.phase is Phase.STANDING
    assert board.state.integrated == Twist()
