"""Presses and sticks to actions, twists, and drive requests tick by tick."""

import pytest

from common.freshness import NS_PER_S
from common.motion import Twist
from common.settings import Vehicle
from services.teleop.config import Teleop
from services.teleop.core.controls import (
    Action,
    Controls,
    Deflection,
    Stick,
    deflection,
    shaped,
)
from services.teleop.core.hold import Press
from t2.client import NEUTRAL, request
from t2.messages import Drive
from tests.teleop.inputs import PERIOD_NS, answer, stick

SETTINGS = Teleop()
FIRST_GEAR = request(0.2)
UP, DOWN = stick(deadman=False), stick()
LIMIT_TICKS = 40  # 2 s


class Operator:
    """Controls with a simulated clock, at a terminal that answers at once."""

    def __init__(self) -> None:
        self.controls = Controls(SETTINGS, Vehicle())
        self.now_ns = 100 * NS_PER_S

    def press(self, keystroke: str, waited_s: float = 0.0, took_s: float = 0.001) -> Action:
        at_ns = self.now_ns - round(waited_s * NS_PER_S)
        answer(self.controls.terminal, at_ns, took_s)
        return self.controls.press(Press(keystroke, at_ns), self.now_ns)

    def ticks(self, count: int, stick: Stick | None = None) -> list[Drive | None]:
        sent = []
        for _ in range(count):
            sent.append(self.controls.tick(stick, self.now_ns))
            self.now_ns += PERIOD_NS
        return sent


@pytest.fixture
def operator() -> Operator:
    return Operator()


def test_keystrokes_are_muted_after_another_source_took_over(operator: Operator) -> None:
    assert not operator.controls.is_muted(operator.now_ns)
    operator.controls.enforce("overruled", operator.now_ns)
    assert operator.controls.is_muted(operator.now_ns)


# --- keys -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "late", "slow", "accepted"),
    [
        ("e", Action.ESTOP, Action.ESTOP, Action.ESTOP),
        ("space", Action.NONE, Action.NONE, Action.NONE),
        ("r", Action.LATE, Action.SLOW, Action.RESET),
        ("w", Action.LATE, Action.SLOW, Action.NONE),
        ("b", Action.LATE, Action.SLOW, Action.NONE),
        ("5", Action.LATE, Action.NONE, Action.NONE),
        ("t", Action.UNKNOWN, Action.UNKNOWN, Action.UNKNOWN),
    ],
)
def test_a_key_counts_by_its_age_and_the_round_trip(
    key: str, late: Action, slow: Action, accepted: Action
) -> None:
    assert Operator().press(key, waited_s=0.51) is late
    assert Operator().press(key, took_s=0.42) is slow
    assert Operator().press(key, waited_s=0.5) is accepted


@pytest.mark.parametrize(("waited_s", "ticks"), [(0.0, 11), (0.3, 5)])
def test_a_tap_is_a_zero_the_twist_and_three_zeros(
    operator: Operator, waited_s: float, ticks: int
) -> None:
    assert operator.ticks(2) == [None, None]
    operator.press("w", waited_s)
    sent = operator.ticks(ticks + 7)
    assert sent == [NEUTRAL] + [FIRST_GEAR] * ticks + [NEUTRAL] * 3 + [None] * 3
    assert operator.controls.is_silent


@pytest.mark.parametrize("key", ["space", "e"])
def test_a_stop_ends_a_hold_at_once_and_sends_zeros_in_any_case(
    operator: Operator, key: str
) -> None:
    for held in ("w", "f", ""):
        operator.press(held)
        operator.ticks(3)
        operator.press(key, waited_s=60.0)
        assert operator.ticks(5) == [NEUTRAL] * 3 + [None] * 2


def test_gears_are_chosen_by_number(operator: Operator) -> None:
    assert operator.controls.top() == Twist(0.2, 0.3)
    operator.press("5")
    operator.press("s")
    assert operator.ticks(2)[-1] == request(-0.8)
    assert operator.controls.top() == Twist(0.8, 0.9)


def test_two_directions_drive_an_arc(operator: Operator) -> None:
    operator.press("w")
    operator.press("a")
    assert operator.ticks(2)[-1] == request(0.2, 0.3)


@pytest.mark.parametrize(("key", "direction"), [("f", "forward"), ("b", "backward")])
def test_a_release_and_driving_exclude_each_other(
    operator: Operator, key: str, direction: str
) -> None:
    operator.press("w")
    operator.ticks(2)
    operator.press(key)
    release = request(release=direction)  # type: ignore[arg-type]
    assert operator.ticks(3, DOWN)[1:] == [release] * 2
    operator.press("w")
    assert operator.ticks(2, DOWN) == [NEUTRAL, FIRST_GEAR]


def test_the_last_direction_of_a_release_counts_and_ends_by_itself(operator: Operator) -> None:
    for key, direction in (("f", "forward"), ("b", "backward"), ("f", "forward")):
        operator.press(key)
        (_, sent) = operator.ticks(2)
        assert sent == request(release=direction)  # type: ignore[arg-type]
    assert operator.controls.holds_keystrokes(operator.now_ns)
    assert operator.ticks(14)[-4:] == [NEUTRAL] * 3 + [None]
    assert not operator.controls.holds_keystrokes(operator.now_ns)


# --- gamepad --------------------------------------------------------------------------------


def test_before_there_is_a_gamepad_it_is_neither_silent_nor_due(operator: Operator) -> None:
    assert operator.controls.is_gamepad_silent is False
    assert operator.controls.is_gamepad_due(operator.now_ns) is False


@pytest.mark.parametrize("key", ["space", "e", "f", "b"])
def test_after_a_stop_or_a_release_the_deadman_must_come_up(operator: Operator, key: str) -> None:
    operator.ticks(1, UP)
    operator.ticks(2, DOWN)
    operator.press(key)
    assert FIRST_GEAR not in operator.ticks(20, DOWN)
    operator.ticks(1, UP)
    assert operator.ticks(2, DOWN)[-1] == FIRST_GEAR


def test_a_gamepad_that_freezes_while_it_drives_is_released(operator: Operator) -> None:
    operator.ticks(1, UP)
    for event in range(1, 60):  # a hand's tremor: three seconds of it
        assert operator.ticks(1, stick(0.6, events=event)) != [None]
    due, frozen = [], []
    for _ in range(100):
        frozen += operator.ticks(1, stick(0.6, events=59))
        due.append(operator.controls.is_gamepad_due(operator.now_ns - PERIOD_NS))
    assert frozen == [frozen[0]] * LIMIT_TICKS + [NEUTRAL] * 3 + [None] * 57
    assert due == [False] * 20 + [True] * 20 + [False] * 60
    for event in range(60, 90):  # it recovers with the stick still pushed
        assert operator.ticks(1, stick(events=event)) == [None]
        assert operator.controls.is_gamepad_silent
    operator.ticks(1, UP)
    assert not operator.controls.is_gamepad_silent
    assert operator.ticks(2, stick(events=91))[-1] == FIRST_GEAR
    assert not operator.controls.is_gamepad_silent


@pytest.mark.parametrize("linear", [0.0, 0.05])
def test_a_stick_at_rest_needs_no_event(operator: Operator, linear: float) -> None:
    operator.ticks(1, UP)
    assert operator.ticks(400, stick(linear, events=1)) == [NEUTRAL] * 400
    assert not operator.controls.is_gamepad_due(operator.now_ns)
    assert operator.ticks(1, stick(events=2)) == [FIRST_GEAR]  # its own movement is an event


# --- mapping --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("held", "push"),
    [
        ([], (0, 0)),
        (["w"], (1, 0)),
        (["down"], (-1, 0)),
        (["a"], (0, 1)),
        (["right"], (0, -1)),
        (["w", "a"], (1, 1)),
        (["z"], (1, 1)),
        (["c"], (1, -1)),
        (["w", "s"], (0, 0)),
        (["w", "up"], (1, 0)),  # twice the same is not twice as fast
        (["z", "w", "a"], (1, 1)),
        (["s", "a"], (-1, 1)),
        (["end"], (-1, -1)),  # the tail goes left
        (["pagedown"], (-1, 1)),
    ],
)
def test_keys_give_a_direction(held: list[str], push: tuple[float, float]) -> None:
    assert deflection(held) == Deflection(*push)


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (0.0, 0.0),
        (0.1, 0.0),
        (-0.1, 0.0),
        (1.0, 1.0),
        (-1.0, -1.0),
        (1.5, 1.0),
        (0.55, (0.125 + 0.5) / 2),  # halfway between a cubic and a straight line
        (-0.55, -(0.125 + 0.5) / 2),
        (0.325, (0.015625 + 0.25) / 2),
    ],
)
def test_a_stick_has_a_deadzone_and_full_deflection(raw: float, expected: float) -> None:
    both = shaped(Deflection(raw, raw), 0.1)
    assert (both.linear, both.angular) == pytest.approx((expected, expected))
