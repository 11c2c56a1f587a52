"""Presses and sticks to requests, tick by tick."""

import pytest

from common.freshness import NS_PER_S
from common.operator import ZERO_TWIST, Twist
from services.teleop.config import Teleop
from services.teleop.controls import Controls
from services.teleop.mapping import Deflection, Stick

PERIOD_NS = NS_PER_S // 20
FIRST_GEAR = Twist(0.2, 0.0)
UP = Stick(Deflection(1, 0), deadman=False, turbo=False)
DOWN = Stick(Deflection(1, 0), deadman=True, turbo=False)


class Hands:
    """Controls on a clock that only ticks move."""

    def __init__(self) -> None:
        self.controls = Controls(Teleop())
        self.now_ns = 0

    def press(self, key: str) -> None:
        self.controls.press(key, self.now_ns)

    def ticks(self, count: int, stick: Stick | None = None) -> list[Twist | None]:
        sent = []
        for _ in range(count):
            sent.append(self.controls.tick(stick, self.now_ns))
            self.now_ns += PERIOD_NS
        return sent


@pytest.fixture
def hands() -> Hands:
    return Hands()


def test_a_tap_is_a_zero_the_twist_for_its_time_three_zeros_and_silence(hands: Hands) -> None:
    assert hands.ticks(2) == [None, None]
    hands.press("w")
    assert hands.ticks(18) == [ZERO_TWIST] + [FIRST_GEAR] * 11 + [ZERO_TWIST] * 3 + [None] * 3
    assert hands.controls.silent


def test_repeats_keep_driving(hands: Hands) -> None:
    for _ in range(20):
        hands.press("w")
        hands.ticks(5)
    assert hands.ticks(1) == [FIRST_GEAR]
    assert hands.ticks(20)[-1] is None


def test_space_ends_a_hold_at_once(hands: Hands) -> None:
    hands.press("w")
    hands.ticks(3)
    hands.press("space")
    assert hands.ticks(5) == [ZERO_TWIST] * 3 + [None] * 2


@pytest.mark.parametrize("key", ["x", "enter", "6", "0", "e", ""])
def test_a_key_without_meaning_moves_nothing(hands: Hands, key: str) -> None:
    hands.press(key)
    assert hands.ticks(3) == [None] * 3


def test_gears_are_chosen_by_number(hands: Hands) -> None:
    hands.press("5")
    hands.press("s")
    assert hands.ticks(2)[-1] == Twist(-0.8, 0.0)


def test_turbo_is_good_for_one_hold(hands: Hands) -> None:
    hands.press("t")
    hands.press("w")
    assert hands.ticks(2)[-1] == Twist(1.0, 0.0)
    hands.ticks(20)
    assert not hands.controls.turbo
    hands.press("w")
    assert hands.ticks(2)[-1] == FIRST_GEAR


@pytest.mark.parametrize("key", ["t", "1", "space"])
def test_turbo_is_called_off(hands: Hands, key: str) -> None:
    hands.press("t")
    hands.press(key)
    assert not hands.controls.turbo


@pytest.mark.parametrize(("key", "direction"), [("f", "forward"), ("b", "backward")])
def test_a_release_and_driving_exclude_each_other(hands: Hands, key: str, direction: str) -> None:
    hands.press("w")
    hands.ticks(2)
    hands.press(key)
    assert hands.controls.released(hands.now_ns) == direction
    assert hands.ticks(4) == [ZERO_TWIST] * 3 + [None]
    hands.press("w")
    assert hands.controls.released(hands.now_ns) is None


def test_the_last_direction_of_a_release_counts(hands: Hands) -> None:
    for key, direction in (("f", "forward"), ("b", "backward"), ("f", "forward")):
        hands.press(key)
        assert hands.controls.released(hands.now_ns) == direction


def test_a_release_ends_by_itself(hands: Hands) -> None:
    hands.press("f")
    hands.ticks(11)
    assert hands.controls.holds_keys(hands.now_ns)
    hands.ticks(1)
    assert hands.controls.released(hands.now_ns) is None
    assert not hands.controls.holds_keys(hands.now_ns)


@pytest.mark.parametrize("key", ["w", "b"])
def test_muted_keys_count_again_after_a_pause(hands: Hands, key: str) -> None:
    hands.press(key)
    hands.controls.mute_keys(hands.now_ns)
    for _ in range(20):  # still held
        hands.press(key)
        assert not hands.controls.holds_keys(hands.now_ns)
        hands.ticks(1)
    hands.ticks(12)
    hands.press(key)
    assert hands.controls.holds_keys(hands.now_ns)


def test_a_gamepad_drives_while_its_deadman_is_down(hands: Hands) -> None:
    assert hands.ticks(2, UP) == [None, None]
    assert hands.ticks(3, DOWN) == [ZERO_TWIST, FIRST_GEAR, FIRST_GEAR]
    assert hands.ticks(4, UP) == [ZERO_TWIST] * 3 + [None]


def test_a_gamepad_has_turbo_of_its_own(hands: Hands) -> None:
    hands.ticks(1, UP)
    sent = hands.ticks(2, Stick(Deflection(1, 0), deadman=True, turbo=True))
    assert sent[-1] == Twist(1.0, 0.0)


def test_a_lost_gamepad_is_a_release_and_its_return_moves_nothing(hands: Hands) -> None:
    hands.ticks(1, UP)
    hands.ticks(3, DOWN)
    assert hands.ticks(4, None) == [ZERO_TWIST] * 3 + [None]
    assert hands.ticks(3, DOWN) == [None] * 3
    hands.ticks(1, UP)
    assert hands.ticks(2, DOWN) == [ZERO_TWIST, FIRST_GEAR]


@pytest.mark.parametrize("key", ["space", "f", "b"])
def test_after_a_stop_the_deadman_must_come_up(hands: Hands, key: str) -> None:
    hands.ticks(1, UP)
    hands.ticks(2, DOWN)
    hands.press(key)
    assert hands.ticks(20, DOWN)[3:] == [None] * 17


def test_a_release_keeps_a_gamepad_out(hands: Hands) -> None:
    hands.press("f")
    hands.ticks(1, UP)
    assert hands.ticks(2, DOWN) == [None, None]


def test_keys_win_over_the_gamepad(hands: Hands) -> None:
    hands.ticks(1, UP)
    hands.press("s")
    assert hands.ticks(2, DOWN)[-1] == Twist(-0.2, 0.0)


def pushed(events: int, linear: float = 0.6, deadman: bool = True) -> Stick:
    """Return a gamepad that has sent so many events."""
    return Stick(Deflection(linear, 0), deadman=deadman, turbo=False, events=events)


LIMIT_TICKS = 40  # 2 s


def test_a_gamepad_that_freezes_while_it_drives_is_released(hands: Hands) -> None:
    hands.ticks(1, pushed(0, deadman=False))
    for event in range(1, 60):  # a hand's tremor: three seconds of it
        assert hands.ticks(1, pushed(event)) != [None]
    frozen = hands.ticks(100, pushed(59))
    driven = [twist for twist in frozen if twist]
    assert driven == [driven[0]] * LIMIT_TICKS + [ZERO_TWIST] * 3
    assert frozen[len(driven) :] == [None] * (100 - len(driven))
    assert hands.controls.gamepad_expired


def test_a_frozen_gamepad_that_comes_back_wants_its_deadman_anew(hands: Hands) -> None:
    hands.ticks(1, pushed(0, deadman=False))
    hands.ticks(60, pushed(1))
    for event in range(2, 30):  # it recovers with the stick still pushed
        assert hands.ticks(1, pushed(event)) == [None]
    hands.ticks(1, pushed(31, deadman=False))
    assert hands.ticks(2, pushed(32))[-1] is not None
    assert not hands.controls.gamepad_expired


@pytest.mark.parametrize("linear", [0.0, 0.05])
def test_a_stick_at_rest_needs_no_event(hands: Hands, linear: float) -> None:
    hands.ticks(1, pushed(0, deadman=False))
    assert hands.ticks(400, pushed(1, linear)) == [ZERO_TWIST] * 400
    assert hands.ticks(1, pushed(2)) != [ZERO_TWIST]  # its own movement is an event


def test_full_deflection_gets_no_longer_limit(hands: Hands) -> None:
    hands.ticks(1, pushed(0, deadman=False))
    assert hands.ticks(LIMIT_TICKS + 3, pushed(1, 1.0))[-2:] == [ZERO_TWIST] * 2


def test_the_operator_is_asked_to_move_the_stick_in_time(hands: Hands) -> None:
    hands.ticks(1, pushed(0, deadman=False))
    due = []
    for _ in range(LIMIT_TICKS + 5):
        hands.ticks(1, pushed(1))
        due.append(hands.controls.gamepad_is_due(hands.now_ns - PERIOD_NS))
    assert due == [False] * 21 + [True] * 20 + [False] * 4


def test_keys_that_end_do_not_hand_over_to_a_frozen_gamepad(hands: Hands) -> None:
    hands.ticks(1, pushed(0, deadman=False))
    hands.ticks(2, pushed(1))
    for _ in range(60):
        hands.press("s")
        hands.ticks(1, pushed(1))
    assert {twist.linear for twist in hands.ticks(30, pushed(1)) if twist} == {-0.2, 0.0}
