"""Standstill supervision: stopping in time, staying there, and what must not trip it."""

import math
import random

import pytest

from common.freshness import NS_PER_S, Latest
from common.messages import Mileage
from common.motion import Twist
from services.safety.standstill import Measured, Phase, Standstill, Supervisor, Velocities
from tests.safety.policy_fixture import TICK_S

TICK_NS = round(TICK_S * NS_PER_S)
SUPERVISOR = Supervisor(0.6, 1.0, Twist(1.0, 1.0))


class Board:
    """A vehicle for the pure core: reports by hand, standstill commanded."""

    def __init__(self, standstill: Standstill | None = None) -> None:
        self.state = standstill or Standstill()
        self.now_ns = 10 * NS_PER_S
        self.distance = self.heading = 0.0
        self.epoch, self.boot = 0, 1
        self.counts = True
        self.mono_ns = 0
        self.supervisor = SUPERVISOR

    def step(
        self, linear: float | None = 0.0, angular: float = 0.0, commanded: bool = True
    ) -> Standstill:
        """Run a tick with one velocity, or without one."""
        self.now_ns += TICK_NS
        known = None if linear is None else Latest(Twist(linear, angular), self.now_ns)
        counters = Mileage(
            distance=self.distance,
            heading=math.remainder(self.heading, math.tau),
            epoch=self.epoch,
            boot=self.boot,
            mono_ns=self.mono_ns,
        )
        seen = Measured(known, Latest(counters, self.now_ns) if self.counts else None)
        self.state = self.supervisor.follow(self.state, commanded, seen, self.now_ns)
        return self.state

    def run(self, seconds: float, linear: float | None = 0.0, angular: float = 0.0) -> bool:
        """Report the same for a while; return whether the place was left meanwhile."""
        steps = [self.step(linear, angular).left for _ in range(round(seconds / TICK_S))]
        return any(steps)

    def late(self) -> bool:
        return self.state.is_late(self.now_ns)


def standing() -> Board:
    board = Board()
    assert not board.run(1.0)
    assert board.state.phase is Phase.STANDING
    return board


# --- stopping -------------------------------------------------------------------------------


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


# --- staying --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("linear", "angular"), [(0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1), (1.0, 0.0)]
)
def test_velocities_alone_detect_an_uncommanded_motion(linear: float, angular: float) -> None:
    board = standing()
    took_s = 0.0
    while not board.run(TICK_S, linear, angular):
        took_s += TICK_S
        assert took_s < 1.0
    away = max(abs(linear), abs(angular)) * took_s
    assert away < 0.05 + 0.02 * max(1.0, abs(linear) * 2)


def test_counters_alone_find_a_creep_however_slow() -> None:
    board = standing()
    for _ in range(49):
        board.distance += 0.001
        assert not board.run(1.0)
    board.distance += 0.002
    assert board.run(1.0)


@pytest.mark.parametrize("metres", [0.049, -0.049, 0.051, -0.051])
def test_the_counters_bound_is_5_cm(metres: float) -> None:
    board = standing()
    left = False
    for _ in range(10):
        board.distance += metres / 10
        left = left or board.step().left
    assert left == (abs(metres) > 0.05)


@pytest.mark.parametrize("turn", [0.048, -0.048, 0.052, -0.052])
def test_the_counters_bound_is_a_twentieth_of_a_radian(turn: float) -> None:
    board = standing()
    board.heading = math.pi - 0.02  # it wraps meanwhile
    board.step()
    assert not board.state.left
    left = False
    for _ in range(10):
        board.heading += turn / 10
        left = left or board.step().left
    assert left == (abs(turn) > 0.05)


@pytest.mark.parametrize(
    ("field", "away", "left"),
    [
        ("distance", 0.6, True),
        ("distance", -1.4, True),
        ("distance", 1.6, False),  # faster than it can move
        ("heading", 0.6, True),
        ("heading", -1.9, True),
        ("heading", 2.1, False),
    ],
)
@pytest.mark.parametrize("at_once", [False, True])
def test_counters_find_a_motion_during_a_stall(
    field: str, away: float, left: bool, at_once: bool
) -> None:
    board = standing()
    setattr(board, field, away)
    if at_once:  # all that waited arrives together
        board.mono_ns = NS_PER_S
    else:
        board.now_ns += NS_PER_S - TICK_NS
    assert board.step().left == left


@pytest.mark.parametrize("field", ["distance", "heading"])
def test_counters_of_a_low_rate_find_a_motion(field: str) -> None:
    board = standing()
    board.now_ns += NS_PER_S // 2 - TICK_NS
    setattr(board, field, 0.06)
    assert board.step().left


def test_it_has_left_once_and_then_has_to_stop_anew() -> None:
    board = standing()
    assert board.run(0.2, 0.5)
    assert not board.state.left
    assert board.state.due_ns is not None
    board.run(0.5 / 0.6 + 0.5, 0.5)
    assert board.late()
    board.run(0.3)
    assert board.state.phase is Phase.STANDING
    assert not board.run(5.0)


# --- what must not trip ---------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_noise_and_bias_do_not_add_up(seed: int) -> None:
    board, noise = standing(), random.Random(seed)
    for _ in range(50 * 120):
        board.distance = noise.choice((0.0, 0.001, -0.001))
        board.heading = noise.gauss(0.0, 0.003)
        assert not board.step(noise.gauss(0.005, 0.03), noise.gauss(0.01, 0.06)).left


def test_a_heading_that_drifts_is_no_motion() -> None:
    board = standing()
    for _ in range(50 * 90):
        board.heading += 0.0008 * TICK_S
        assert not board.step().left
    assert abs(board.state.counted.angular) < 0.001


def test_a_single_wrong_velocity_is_no_motion() -> None:
    board = standing()
    assert not board.step(5.0, 10.0).left
    assert not board.run(1.0)
    board.run(1.0, None)  # not even the first after a silence
    assert not board.step(5.0).left
    assert not board.run(1.0)


@pytest.mark.parametrize("jump", [0.06, 3.0, -3.0, math.nan, math.inf])
def test_a_counter_that_jumps_is_no_motion(jump: float) -> None:
    board = standing()
    board.distance, before = jump, board.distance
    board.heading += 0.0 if math.isinf(jump) or math.isnan(jump) else jump
    assert not board.step().left
    board.distance, board.heading = before, 0.0
    assert not board.run(1.0)


@pytest.mark.parametrize("field", ["epoch", "boot"])
def test_other_counters_begin_anew(field: str) -> None:
    board = standing()
    board.distance = 0.04
    assert not board.run(0.1)
    setattr(board, field, 7)
    board.distance = 0.0
    assert not board.run(0.1)
    assert board.state.counted.linear == pytest.approx(0.04)
    board.distance = 0.02
    assert board.run(0.1)


def test_without_counters_the_velocities_are_enough() -> None:
    board = Board()
    board.counts = False
    board.run(1.0)
    assert board.run(1.0, 0.1)


def test_a_motion_that_was_commanded_is_none_of_it() -> None:
    board = standing()
    for _ in range(50):
        board.distance += 0.02
        assert not board.step(1.0, commanded=False).left
    assert board.state.phase is Phase.MOVING
