"""Hold to drive: which keystrokes and which gamepad count as held, and what ends that.

A terminal sends a keystroke when a button goes down and again while it stays down, but nothing when
it comes up. A keystroke is therefore held until a deadline: ``hold_first`` seconds after its first
press (most terminals send the first repeat after half a second) and ``HOLD_S`` seconds after each
repeat. A gamepad's deadman button reports both edges, but it counts only after it was seen up.

After each of these rules, controls that are still held down count as let go (``RULES``):

============== ============================================ ================== ==================
rule           condition                                    keystrokes count   deadman counts
============== ============================================ ================== ==================
stop           space, E, quit                               with the next      after it was up
                                                            press
unfocused      the terminal lost the focus, and with it     with the next      after it was up
               the repeats                                  press
terminal_slow  ``round_trip`` refuses a keystroke           after a pause      kept
unheard        no state of safety for a second, or the      after a pause      after it was up
               program was suspended
overruled      another source drives for half a second      after a pause      after it was up
gamepad_silent deflected stick, reading unchanged for       kept               after it was up
               ``GAMEPAD_SILENCE_S``
gamepad_gone   no gamepad, or a screen or terminal that     kept               after it was up
               hangs
============== ============================================ ================== ==================

The pause is ``hold_first`` without any keystroke: one that repeats is still held, and an old
request.

A gamepad that freezes while its USB receiver stays enumerated keeps its last state. An unchanged
reading alone is no fault: a stick at rest requests zero. A thumb on a deflected stick is never
still: at 8 to 16 bits its tremor changes one of the two axes many times a second. At the mechanical
end one axis may be clamped, but the cross axis is not, and every axis, hat and button counts. The
screen asks for a movement after half of the limit.
"""

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from common.freshness import NS_PER_S
from t2.messages import SafetyState

HOLD_S = 0.3  # that a repeat drives
GAMEPAD_SILENCE_S = 2.0  # without a change; the page's gamepad.js has the same


class Again(Enum):
    """When keystrokes that were let go count again."""

    KEPT = "kept"
    NEXT_PRESS = "with the next press"
    AFTER_PAUSE = "after a pause"


class Rule(NamedTuple):
    """What a rule lets go of."""

    keystrokes: Again
    deadman: bool  # counts again after it was up


RULES = {
    "stop": Rule(Again.NEXT_PRESS, True),
    "unfocused": Rule(Again.NEXT_PRESS, True),
    "terminal_slow": Rule(Again.AFTER_PAUSE, False),
    "unheard": Rule(Again.AFTER_PAUSE, True),
    "overruled": Rule(Again.AFTER_PAUSE, True),
    "gamepad_silent": Rule(Again.KEPT, True),
    "gamepad_gone": Rule(Again.KEPT, True),
}


@dataclass(frozen=True, slots=True)
class Press:
    """A press of a keystroke or its repeat, as the screen received it from the terminal."""

    keystroke: str
    at_ns: int  # when it was read
    shown: SafetyState | None = None  # the state that the screen showed at this time

    def age_s(self, now_ns: int) -> float:
        """Return the time since it was read, in seconds."""
        return (now_ns - self.at_ns) / NS_PER_S


class HeldKeystrokes:
    """The held keystrokes, by deadlines."""

    def __init__(self, first_s: float) -> None:
        self._first_ns = round(first_s * NS_PER_S)
        self._repeat_ns = round(HOLD_S * NS_PER_S)
        self._until_ns: dict[str, int] = {}
        self._muted_until_ns = 0

    def press(self, keystroke: str, now_ns: int) -> None:
        """Handle a press or its repeat; a terminal does not distinguish them."""
        if self.is_muted(now_ns):
            self.let_go(Again.AFTER_PAUSE, now_ns)
            return
        hold_ns = self._repeat_ns if keystroke in self.held(now_ns) else self._first_ns
        self._until_ns[keystroke] = now_ns + hold_ns

    def keep(self, keystrokes: Collection[str]) -> None:
        """Let go of all others."""
        self._until_ns = {one: at for one, at in self._until_ns.items() if one in keystrokes}

    def held(self, now_ns: int) -> list[str]:
        """Return the keystrokes that are held."""
        return [one for one, until_ns in self._until_ns.items() if now_ns < until_ns]

    def let_go(self, again: Again, now_ns: int) -> None:
        """Let go of all keystrokes, until they count again."""
        if again is not Again.KEPT:
            self._until_ns.clear()
        if again is Again.AFTER_PAUSE:
            self._muted_until_ns = now_ns + self._first_ns

    def is_muted(self, now_ns: int) -> bool:
        """Return whether presses are still ignored."""
        return now_ns < self._muted_until_ns


class Deadman:
    """A gamepad's button that enables motion while it is down, and the changes of its reading."""

    def __init__(self) -> None:
        self.is_held = False
        self._seen_up = False
        self._events: int | None = None
        self._event_ns = 0  # the last change

    def update(self, down: bool, events: int, now_ns: int) -> None:
        """Process the button and the number of changes of the reading."""
        self._seen_up = self._seen_up or not down
        self.is_held = down and self._seen_up
        if events != self._events:
            self._events, self._event_ns = events, now_ns

    def drop(self) -> None:
        """Let go of it: it counts again after it was up."""
        self.is_held = self._seen_up = False

    def is_due(self, now_ns: int) -> bool:
        """Return whether the operator should move the stick to keep driving."""
        return self._quiet_s(now_ns) > GAMEPAD_SILENCE_S / 2

    def is_silent(self, now_ns: int) -> bool:
        """Return whether a deflected stick may no longer drive."""
        return self._quiet_s(now_ns) > GAMEPAD_SILENCE_S

    def _quiet_s(self, now_ns: int) -> float:
        return (now_ns - self._event_ns) / NS_PER_S
