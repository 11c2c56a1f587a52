"""Motion watch: runaway on one axis, and the phases of a standstill."""

import math
from typing import Any

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.motion import STILL, Twist
from common.settings import Vehicle
from common.standstill import GRACE_NS
from services.safety.config import SafetyConfig
from services.safety.core.motion_watch import (
    CONFIRM_NS,
    Bounds,
    MotionWatch,
    Phase,
    Runaway,
    Standstill,
    Supervisor,
)
from t2.messages import Mileage
from tests.safety.core.policy_fixture import TICK_S

TICK_NS = round(TICK_S * NS_PER_S)
BOUNDS = Bounds(deceleration=0.6, tolerance=0.3, against=0.1, patience_s=0.3)
SETTINGS = SafetyConfig()  # slows down at 0.6 m/s^2 and 1.0 rad/s^2


def follow(axis: Runaway, commanded: float, measured: float, seconds: float) -> Runaway:
    for _ in range(round(seconds / TICK_S)):
        axis = axis.follow(commanded, measured, TICK_S, BOUNDS)
    return axis


@pytest.mark.parametrize(
    ("commanded", "measured", "bad"),
    [
        (0.5, 0.5, False), (0.5, 0.8, False), (0.5, 0.81, True), (-0.5, -0.81, True),
        (-0.5, -0.79, False), (0.5, 0.0, False), (0.5, -0.1, False), (0.5, -0.11, True),
        (-0.5, 0.11, True), (-0.5, 0.1, False), (0.0, 0.3, False), (0.0, 0.31, True),
        (0.0, -0.3, False), (0.0, -0.31, True),
    ],
)  # fmt: skip
def test_runaway_bounds(commanded: float, measured: float, bad: bool) -> None:
    assert (follow(Runaway(), commanded, measured, 0.28).bad_s > 0.27) == bad


@pytest.mark.parametrize("sign", [1, -1])
def test_slowing_down_as_guaranteed_is_no_runaway(sign: int) -> None:
    axis = follow(Runaway(), sign, sign, 1.0)
    for step in range(100):
        late_s = max(0.0, step * TICK_S - 0.25)
        axis = axis.follow(0.0, sign * max(0.0, 1.0 - 0.6 * late_s), TICK_S, BOUNDS)
        assert axis.bad_s == 0


def test_bad_time_is_forgiven_half_as_fast_and_is_capped() -> None:
    axis = follow(Runaway(), 0.0, 1.0, 9.0)
    assert axis.bad_s == BOUNDS.patience_s
    assert follow(axis, 0.0, 0.0, 0.2).bad_s == pytest.approx(0.2)
    axis = Runaway()
    for _ in range(20):  # flapping
        axis = follow(follow(axis, 0.0, 1.0, 0.04), 0.0, 0.0, 0.04)
    assert axis.bad_s > 0.27


# --- standstill -----------------------------------------------------------------------------


class Board:
    """A vehicle for the supervisor: velocities and counters by hand."""

    def __init__(self, settings: SafetyConfig = SETTINGS) -> None:
        self.watch = MotionWatch()
        self.now_ns = 10 * NS_PER_S
        self.distance = self.heading = 0.0
        self.supervisor = Supervisor(settings)

    @property
    def state(self) -> Standstill:
        return self.watch.standstill

    def step(
        self, linear: float | None = 0.0, angular: float = 0.0, *, moves: bool = False
    ) -> Standstill:
        """Run a tick with one velocity, or without one; ``moves``: a motion is commanded."""
        self.now_ns += TICK_NS
        known = None if linear is None else Latest(Twist(linear, angular), self.now_ns)
        heading = math.remainder(self.heading, math.tau)
        counters = Mileage(distance=self.distance, heading=heading, epoch=0)
        self.watch = self.supervisor.follow(
            self.watch,
            Twist(linear or 0.3, angular) if moves else STILL,
            known,
            Latest(counters, self.now_ns),
            step_s=TICK_S,
            now_ns=self.now_ns,
        )
        return self.state

    def run(self, seconds: float, linear: float | None = 0.0, angular: float = 0.0) -> bool:
        """Report the same for a while; return whether the place was left meanwhile."""
        steps = [self.step(linear, angular).has_left for _ in range(round(seconds / TICK_S))]
        return any(steps)

    def late(self) -> bool:
        return self.state.is_late(self.now_ns)


def standing() -> Board:
    board = Board()
    assert not board.run(1.0)
    assert board.state.phase is Phase.STANDING
    return board


def stopping(linear: float | None, angular: float = 0.0) -> Board:
    """Return a vehicle whose motion has just ended."""
    board = Board()
    board.step(linear, angular, moves=True)
    assert board.state.phase is Phase.MOVING
    return board


@pytest.mark.parametrize(
    ("linear", "angular", "due_s"),
    [(0.28, 0.0, 0.28 / 0.6 + 0.5), (0.0, 0.49, 0.99), (-0.28, 0.0, 0.28 / 0.6 + 0.5),
     (0.6, -0.1, 1.5), (0.06, -0.9, 1.4)],
)  # fmt: skip
def test_time_to_stop_by_speed(linear: float, angular: float, due_s: float) -> None:
    board = stopping(linear, angular)
    began_ns = board.now_ns
    while not board.late():
        board.step(linear, angular)
        assert board.now_ns < began_ns + 3 * NS_PER_S
    took_s = (board.now_ns - began_ns) / NS_PER_S
    assert due_s < took_s <= due_s + 3 * TICK_S
    assert board.state.rolls


@pytest.mark.parametrize("slow", [{"deceleration": 0.1}, {"angular_deceleration": 0.1}])
def test_time_to_stop_is_at_most_3_s(slow: dict[str, Any]) -> None:
    board = Board(replace(SETTINGS, vehicle=Vehicle(sonar_max=20.0, **slow)))
    board.step(1.0, 1.0, moves=True)
    board.run(3.0, 1.0, 1.0)
    assert not board.late()
    board.run(2 * TICK_S, 1.0, 1.0)
    assert board.late()


@pytest.mark.parametrize(("linear", "angular", "stop_s"), [(0.7, 0.4, 0.7 / 0.6), (0.1, 0.9, 0.9)])
def test_an_unknown_velocity_counts_as_the_fastest(
    linear: float, angular: float, stop_s: float
) -> None:
    board = Board(replace(SETTINGS, vehicle=Vehicle(max_linear=linear, max_angular=angular)))
    board.step(None, moves=True)
    board.step(None)
    assert board.state.due_ns == board.now_ns + round(stop_s * NS_PER_S) + GRACE_NS
    board.run(stop_s + 0.5, None)
    assert not board.late()
    board.run(2 * TICK_S, None)
    assert board.late()
    assert not board.state.rolls


def test_the_first_known_velocity_shortens_the_limit_once() -> None:
    board = stopping(1.0)
    board.step(None)
    began_ns = board.now_ns
    assert board.state.due_ns == began_ns + round(NS_PER_S / 0.6) + GRACE_NS
    due_ns = board.step(0.3).due_ns
    assert due_ns == board.now_ns + NS_PER_S
    board.step(None)  # a later gap does not extend the limit
    assert board.step(1.0).due_ns == due_ns


def test_at_start_the_limit_counts_from_the_first_velocity() -> None:
    board = Board()
    board.run(60.0, None)
    assert not board.late()
    board.run(1.0, 0.3)
    assert not board.late()
    board.run(2 * TICK_S, 0.3)
    assert board.late()


@pytest.mark.parametrize(("ticks", "renewed"), [(1, False), (24, False), (25, True)])
def test_a_motion_of_half_a_second_renews_the_limit(ticks: int, renewed: bool) -> None:
    board = stopping(0.3)
    due_ns = board.step(0.3).due_ns
    assert due_ns is not None
    for _ in range(ticks):
        board.step(0.9, moves=True)
    after_ns = board.step(0.9).due_ns
    assert after_ns is not None
    assert board.state.phase is Phase.STOPPING
    assert (after_ns - board.now_ns == round(0.9 / 0.6 * NS_PER_S) + GRACE_NS) == renewed
    assert (after_ns == due_ns + ticks * TICK_NS) != renewed


def test_a_vehicle_that_stood_has_a_new_limit() -> None:
    board = stopping(0.3)
    board.run(0.1, 0.3)
    board.step(0.0, moves=True)
    board.step(0.3, moves=True)
    assert board.state.due_ns is None
    assert board.step(0.3).due_ns == board.now_ns + NS_PER_S


def test_a_motion_between_begins_the_confirmation_anew() -> None:
    board = stopping(0.4)
    board.run(0.1, 0.4)
    board.run(0.1, 0.0)
    board.run(0.1, -0.1)  # the rebound of a contact
    stood_ns = [board.state.still_ns]
    board.run(0.18)
    assert [*stood_ns, board.state.phase] == [None, Phase.STOPPING]
    board.run(0.1)
    assert board.state.phase is Phase.STANDING
    assert board.state.displacement.integrated == STILL


def test_standstill_is_confirmed_after_0_2_s() -> None:
    board = stopping(0.3)
    board.step(0.0)
    still_ns = board.step(0.0).still_ns
    assert still_ns == board.now_ns
    while board.step(0.0).phase is Phase.STOPPING:
        assert board.now_ns < still_ns + NS_PER_S
    assert board.now_ns == still_ns + CONFIRM_NS


def test_a_command_to_move_ends_the_measured_standstill() -> None:
    board = stopping(0.3)
    board.run(0.1)
    assert board.state.still_ns is not None
    assert board.step(0.0, moves=True).still_ns is None


def test_a_vehicle_that_left_its_place_has_a_new_limit() -> None:
    board = standing()
    while not board.step(0.3).has_left:
        assert board.state.phase is Phase.STANDING
    assert board.state.phase is Phase.STOPPING
    assert board.state.due_ns == board.now_ns + NS_PER_S


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
