"""Standstill supervision: staying at a place, and what is no motion."""

import math
import random

import pytest

from common.freshness import NS_PER_S
from services.safety.standstill import Phase
from tests.safety.policy_fixture import TICK_S
from tests.safety.standstill_fixture import TICK_NS, Board, standing

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
