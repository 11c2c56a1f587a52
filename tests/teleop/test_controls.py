"""Key presses and sticks to twists, and to drive requests tick by tick."""

import pytest

from common.freshness import NS_PER_S
from common.motion import STILL, Twist
from common.operator import Request
from services.teleop.config import Teleop
from services.teleop.controls import (
    Controls,
    Deflection,
    Stick,
)

SETTINGS = Teleop()
PERIOD_NS = NS_PER_S // 20
FIRST_GEAR = Twist(0.2, 0.0)
UP = Stick(Deflection(1, 0), deadman=False, turbo=False)
DOWN = Stick(Deflection(1, 0), deadman=True, turbo=False)


class Operator:
    """Controls with a simulated clock that advances by ticks."""

    def __init__(self) -> None:
        self.controls = Controls(Teleop())
        self.now_ns = 0

    def press(self, key: str) -> None:
        self.controls.press(key, self.now_ns)

    def requests(self, count: int, stick: Stick | None = None) -> list[Request | None]:
        sent = []
        for _ in range(count):
            sent.append(self.controls.tick(stick, self.now_ns))
            self.now_ns += PERIOD_NS
        return sent

    def ticks(self, count: int, stick: Stick | None = None) -> list[Twist | None]:
        return [one.twist if one else None for one in self.requests(count, stick)]

    def releases(self, count: int) -> list[str | None]:
        return [one.release if one else None for one in self.requests(count)]


@pytest.fixture
def operator() -> Operator:
    return Operator()


def test_a_tap_is_a_zero_the_twist_and_three_zeros(operator: Operator) -> None:
    assert operator.ticks(2) == [None, None]
    operator.press("w")
    assert operator.ticks(18) == [STILL] + [FIRST_GEAR] * 11 + [STILL] * 3 + [None] * 3
    assert operator.controls.silent


def test_repeats_keep_driving(operator: Operator) -> None:
    for _ in range(20):
        operator.press("w")
        operator.ticks(5)
    assert operator.ticks(1) == [FIRST_GEAR]
    assert operator.ticks(20)[-1] is None


def test_space_ends_a_hold_at_once(operator: Operator) -> None:
    operator.press("w")
    operator.ticks(3)
    operator.press("space")
    assert operator.ticks(5) == [STILL] * 3 + [None] * 2


@pytest.mark.parametrize("key", ["x", "enter", "6", "0", "e", ""])
def test_an_unknown_key_moves_nothing(operator: Operator, key: str) -> None:
    operator.press(key)
    assert operator.ticks(3) == [None] * 3


def test_gears_are_chosen_by_number(operator: Operator) -> None:
    operator.press("5")
    operator.press("s")
    assert operator.ticks(2)[-1] == Twist(-0.8, 0.0)


def test_turbo_lasts_for_one_hold(operator: Operator) -> None:
    operator.press("t")
    operator.press("w")
    assert operator.ticks(2)[-1] == Twist(1.0, 0.0)
    operator.ticks(20)
    assert not operator.controls.turbo
    operator.press("w")
    assert operator.ticks(2)[-1] == FIRST_GEAR


@pytest.mark.parametrize("key", ["t", "1", "space"])
def test_turbo_is_cancelled(operator: Operator, key: str) -> None:
    operator.press("t")
    operator.press(key)
    assert not operator.controls.turbo


@pytest.mark.parametrize(("key", "direction"), [("f", "forward"), ("b", "backward")])
def test_a_release_and_driving_exclude_each_other(
    operator: Operator, key: str, direction: str
) -> None:
    operator.press("w")
    operator.ticks(2)
    operator.press(key)
    assert operator.controls.released(operator.now_ns) == direction
    assert operator.releases(3) == ["none", direction, direction]
    operator.press("w")
    assert operator.controls.released(operator.now_ns) is None
    assert operator.ticks(2) == [STILL, FIRST_GEAR]


def test_the_last_direction_of_a_release_counts(operator: Operator) -> None:
    for key, direction in (("f", "forward"), ("b", "backward"), ("f", "forward")):
        operator.press(key)
        assert operator.controls.released(operator.now_ns) == direction


def test_a_release_ends_by_itself(operator: Operator) -> None:
    operator.press("f")
    operator.ticks(11)
    assert operator.controls.holds_keys(operator.now_ns)
    operator.ticks(1)
    assert operator.controls.released(operator.now_ns) is None
    assert not operator.controls.holds_keys(operator.now_ns)


@pytest.mark.parametrize("key", ["w", "b"])
def test_muted_keys_count_again_after_a_pause(operator: Operator, key: str) -> None:
    operator.press(key)
    operator.controls.mute_keys(operator.now_ns)
    for _ in range(20):  # still held
        operator.press(key)
        assert not operator.controls.holds_keys(operator.now_ns)
        operator.ticks(1)
    operator.ticks(12)
    operator.press(key)
    assert operator.controls.holds_keys(operator.now_ns)


def test_a_gamepad_drives_while_its_deadman_is_down(operator: Operator) -> None:
    assert operator.ticks(2, UP) == [None, None]
    assert operator.ticks(3, DOWN) == [STILL, FIRST_GEAR, FIRST_GEAR]
    assert operator.ticks(4, UP) == [STILL] * 3 + [None]


def test_a_gamepad_has_turbo_of_its_own(operator: Operator) -> None:
    operator.ticks(1, UP)
    sent = operator.ticks(2, Stick(Deflection(1, 0), deadman=True, turbo=True))
    assert sent[-1] == Twist(1.0, 0.0)


def test_a_lost_gamepad_releases_and_its_return_moves_nothing(operator: Operator) -> None:
    operator.ticks(1, UP)
    operator.ticks(3, DOWN)
    assert operator.ticks(4, None) == [STILL] * 3 + [None]
    assert operator.ticks(3, DOWN) == [None] * 3
    operator.ticks(1, UP)
    assert operator.ticks(2, DOWN) == [STILL, FIRST_GEAR]


@pytest.mark.parametrize("key", ["space", "f", "b"])
def test_after_a_stop_the_deadman_must_come_up(operator: Operator, key: str) -> None:
    operator.ticks(1, UP)
    operator.ticks(2, DOWN)
    operator.press(key)
    sent = operator.ticks(24, DOWN)
    assert {twist for twist in sent if twist} <= {STILL}  # a release moves nothing by its twist
    assert sent[16:] == [None] * 8


def test_a_release_excludes_the_gamepad(operator: Operator) -> None:
    operator.press("f")
    operator.ticks(1, UP)
    assert operator.ticks(2, DOWN) == [STILL, STILL]


def test_keys_have_priority_over_the_gamepad(operator: Operator) -> None:
    operator.ticks(1, UP)
    operator.press("s")
    assert operator.ticks(2, DOWN)[-1] == Twist(-0.2, 0.0)


def pushed(events: int, linear: float = 0.6, deadman: bool = True) -> Stick:
    """Return a gamepad that has sent so many events."""
    return Stick(Deflection(linear, 0), deadman=deadman, turbo=False, events=events)


LIMIT_TICKS = 40  # 2 s


def test_a_gamepad_that_freezes_while_it_drives_is_released(operator: Operator) -> None:
    operator.ticks(1, pushed(0, deadman=False))
    for event in range(1, 60):  # a hand's tremor: three seconds of it
        assert operator.ticks(1, pushed(event)) != [None]
    frozen = operator.ticks(100, pushed(59))
    driven = [twist for twist in frozen if twist]
    assert driven == [driven[0]] * LIMIT_TICKS + [STILL] * 3
    assert frozen[len(driven) :] == [None] * (100 - len(driven))
    assert operator.controls.gamepad_expired


def test_a_frozen_gamepad_that_recovers_needs_its_deadman_again(operator: Operator) -> None:
    operator.ticks(1, pushed(0, deadman=False))
    operator.ticks(60, pushed(1))
    for event in range(2, 30):  # it recovers with the stick still pushed
        assert operator.ticks(1, pushed(event)) == [None]
    operator.ticks(1, pushed(31, deadman=False))
    assert operator.ticks(2, pushed(32))[-1] is not None
    assert not operator.controls.gamepad_expired


@pytest.mark.parametrize("linear", [0.0, 0.05])
def test_a_stick_at_rest_needs_no_event(operator: Operator, linear: float) -> None:
    operator.ticks(1, pushed(0, deadman=False))
    assert operator.ticks(400, pushed(1, linear)) == [STILL] * 400
    assert operator.ticks(1, pushed(2)) != [STILL]  # its own movement is an event


def test_full_deflection_has_the_same_limit(operator: Operator) -> None:
    operator.ticks(1, pushed(0, deadman=False))
    assert operator.ticks(LIMIT_TICKS + 3, pushed(1, 1.0))[-2:] == [STILL] * 2


def test_the_operator_is_asked_to_move_the_stick_in_time(operator: Operator) -> None:
    operator.ticks(1, pushed(0, deadman=False))
    due = []
    for _ in range(LIMIT_TICKS + 5):
        operator.ticks(1, pushed(1))
        due.append(operator.controls.gamepad_is_due(operator.now_ns - PERIOD_NS))
    assert due == [False] * 21 + [True] * 20 + [False] * 4


def test_after_the_keys_a_frozen_gamepad_does_not_drive(operator: Operator) -> None:
    operator.ticks(1, pushed(0, deadman=False))
    operator.ticks(2, pushed(1))
    for _ in range(60):
        operator.press("s")
        operator.ticks(1, pushed(1))
    assert {twist.linear for twist in operator.ticks(30, pushed(1)) if twist} == {-0.2, 0.0}
