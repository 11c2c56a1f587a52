"""Hold to drive: deadlines of keystrokes, the deadman, and the rules as one stateful property."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule

from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.teleop.config import Teleop
from services.teleop.core.controls import Controls, Deflection, Stick
from services.teleop.core.hold import (
    GAMEPAD_SILENCE_S,
    HOLD_S,
    RULES,
    Again,
    Deadman,
    HeldKeystrokes,
    Press,
)
from t2.client import NEUTRAL, ZEROS


def at(seconds: float) -> int:
    return round(seconds * NS_PER_S)


@pytest.mark.parametrize(
    ("presses", "held", "released"),
    [
        ([("w", 10.0)], {10.0: "w", 10.599: "w"}, 10.6),  # a tap
        ([("w", 10.0), ("w", 10.5)], {10.799: "w"}, 10.8),  # a repeat holds for less
        ([("w", 10.0), ("w", 10.6)], {11.199: "w"}, 11.2),  # a first press again
        ([("w", 10.0), ("a", 10.5)], {10.55: "wa", 10.7: "a"}, 11.1),  # own deadlines
    ],
)
def test_deadlines_of_keystrokes(
    presses: list[tuple[str, float]], held: dict[float, str], released: float
) -> None:
    held_ones = HeldKeystrokes(first_s=0.6)
    assert not held_ones.is_muted(0)
    for keystroke, at_s in presses:
        held_ones.press(keystroke, at(at_s))
    for at_s, names in held.items():
        assert held_ones.held(at(at_s)) == list(names)
    assert held_ones.held(at(released)) == []


def test_keystrokes_that_are_muted_count_after_a_pause_without_presses() -> None:
    held_ones = HeldKeystrokes(first_s=0.6)
    held_ones.let_go(Again.AFTER_PAUSE, at(10.0))
    held_ones.press("w", at(10.3))  # the pause begins again
    assert held_ones.is_muted(at(10.3 + HOLD_S))
    assert held_ones.held(at(10.4)) == []
    held_ones.press("w", at(12.0))
    assert held_ones.held(at(12.1)) == ["w"]


def test_a_deadman_counts_after_it_was_up() -> None:
    deadman = Deadman()
    assert deadman.is_held is False
    for down, held in ((True, False), (False, False), (True, True)):
        deadman.update(down, 0, 0)
        assert deadman.is_held is held
    deadman.drop()
    assert deadman.is_held is False


# When keystrokes count again, and whether the deadman must come up, by rule.
EXPECTED = {
    "stop": ("with the next press", True),
    "unfocused": ("with the next press", True),
    "terminal_slow": ("after a pause", False),
    "unheard": ("after a pause", True),
    "overruled": ("after a pause", True),
    "gamepad_silent": ("kept", True),
    "gamepad_gone": ("kept", True),
}


def test_the_table_of_rules() -> None:
    assert {name: (each.keystrokes.value, each.deadman) for name, each in RULES.items()} == EXPECTED


class Hold(RuleBasedStateMachine):
    """Keystrokes, a gamepad and rules in any order, against what the operator's hands did.

    Nothing moves without a hand that holds since the last rule; a hand that holds, moves; a drive
    begins with a zero and ends with three.
    """

    def __init__(self) -> None:
        super().__init__()
        self.settings = Teleop()
        self.controls = Controls(self.settings, Vehicle())
        self.now_ns = at(100)
        self.until_ns: dict[str, int] = {}  # the last moment at which a keystroke may drive
        self.counts_ns = 0  # when keystrokes count again
        self.stick: Stick | None = None
        self.was_up = False  # the deadman, since the last rule
        self.events = 0  # of the gamepad
        self.moved_ns = 0  # the last one
        self.zeros = ZEROS  # sent since the last motion
        self.was_held = False

    @rule(keystroke=st.sampled_from("wasdzc"))
    def press(self, keystroke: str) -> None:
        self.controls.terminal.sent((0, 1), self.now_ns)
        self.controls.terminal.answered((0, 1), self.now_ns)
        self.controls.press(Press(keystroke, self.now_ns), self.now_ns)
        if self.now_ns < self.counts_ns:
            self.counts_ns = self.now_ns + at(self.settings.hold_first)
            return
        repeats = self.now_ns < self.until_ns.get(keystroke, 0)
        hold_s = HOLD_S if repeats else self.settings.hold_first
        self.until_ns[keystroke] = self.now_ns + at(hold_s)

    @rule(name=st.sampled_from(sorted(EXPECTED)))
    def enforce(self, name: str) -> None:
        self.controls.enforce(name, self.now_ns)
        again, deadman = EXPECTED[name]
        if again != "kept":
            self.until_ns = {}
        if again == "after a pause":
            self.counts_ns = self.now_ns + at(self.settings.hold_first)
        if deadman:
            self.was_up = False

    @rule(push=st.sampled_from((-1.0, 0.0, 0.05, 0.5)), deadman=st.booleans())
    def move_stick(self, push: float, deadman: bool) -> None:
        self.events += 1
        self.stick = Stick(Deflection(push, 0.0), deadman, self.events)
        self.moved_ns = self.now_ns

    @precondition(lambda self: self.stick is not None)
    @rule()
    def unplug(self) -> None:
        self.stick = None

    @rule(ticks=st.sampled_from((1, 2, 5, 7, 13, 41)))
    def tick(self, ticks: int) -> None:
        for _ in range(ticks):
            self.check()
            self.now_ns += NS_PER_S // 20

    def check(self) -> None:
        assert self.controls.is_muted(self.now_ns) is (self.now_ns < self.counts_ns)
        request = self.controls.tick(self.stick, self.now_ns)
        by_keystrokes = {one for one, until_ns in self.until_ns.items() if self.now_ns < until_ns}
        self.was_up = self.stick is not None and (self.was_up or not self.stick.deadman)
        by_stick = self.stick is not None and self.stick.deadman and self.was_up
        push = self.stick.push.linear if self.stick else 0.0
        is_late = self.now_ns - self.moved_ns > at(GAMEPAD_SILENCE_S)
        if by_stick and not by_keystrokes and abs(push) > self.settings.deadzone and is_late:
            by_stick = self.was_up = False
        is_held, alone = bool(by_keystrokes) or by_stick, len(by_keystrokes) == 1
        moves = request not in (None, NEUTRAL)
        if is_held and self.was_held and (alone or (not by_keystrokes and abs(push) > 0.1)):
            assert moves
        if not is_held or not self.was_held:
            assert not moves
        assert (request is None) == (not is_held and self.zeros == ZEROS)
        self.zeros = 0 if is_held else min(ZEROS, self.zeros + 1)
        self.was_held = is_held


Hold.TestCase.settings = settings(max_examples=200, stateful_step_count=40)
TestHold = Hold.TestCase
