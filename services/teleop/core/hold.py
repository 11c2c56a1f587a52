"""Hold to drive: which keys count as held, and when a gamepad counts.

**Keys.** A terminal sends a key when it goes down and again while it stays down, but nothing when
it comes up. A key is therefore held until a deadline: ``first`` seconds after its first press (most
terminals send the first repeat after half a second) and ``repeat`` seconds after each repeat. After
a loss of the bus, keys count only after ``first`` seconds without any key: a key that is still held
then is an old request.

**Deadman.** A gamepad's button reports both edges, but it counts only after it was seen up. A
button that is down when the gamepad is found, or after a stop, must be released first.

**Gamepad watchdog.** A gamepad that freezes while its USB receiver stays enumerated keeps its last
state: the deadman stays down, the stick stays deflected. SDL reports changes only, so silence alone
is no fault:

========= ============ ==================== ==========================================
deadman   stick        events               gamepad
========= ============ ==================== ==========================================
up        any          any or none          moves nothing
down      at rest      any or none          requests zero, which is harmless
down      deflected    one within the limit drives
down      deflected    none within it       released, until the deadman was released
========= ============ ==================== ==========================================

A thumb on a deflected stick is never still: at 8 to 16 bits its tremor changes one of the two axes
many times a second. At the mechanical end one axis may be clamped, but the cross axis is not, and
every axis, hat and button counts. Full deflection is the fastest motion, so it has the same limit.
The screen asks for a movement after half of it.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from common.freshness import NS_PER_S
from common.messages import SafetyState


@dataclass(frozen=True, slots=True)
class Press:
    """A key press or its repeat, as the screen received it from the terminal."""

    key: str
    at_ns: int  # when it was read
    shown: SafetyState | None = None  # the state that the screen showed at this time

    def age_s(self, now_ns: int) -> float:
        """Return the time since it was read, in seconds."""
        return (now_ns - self.at_ns) / NS_PER_S


class Keys:
    """The held keys, by deadlines."""

    def __init__(self, first_s: float, repeat_s: float) -> None:
        self._first_ns = round(first_s * NS_PER_S)
        self._repeat_ns = round(repeat_s * NS_PER_S)
        self._until_ns: dict[str, int] = {}
        self._muted_until_ns: int | None = None

    def press(self, key: str, now_ns: int) -> None:
        """Handle a key press or its repeat; a terminal does not distinguish them."""
        if self.is_muted(now_ns):
            self.mute(now_ns)
            return
        hold_ns = self._repeat_ns if key in self.held(now_ns) else self._first_ns
        self._until_ns[key] = now_ns + hold_ns

    def press_alone(self, key: str, now_ns: int) -> None:
        """Handle a key press or its repeat, and release every other key."""
        self._until_ns = {held: at for held, at in self._until_ns.items() if held == key}
        self.press(key, now_ns)

    def held(self, now_ns: int) -> Iterable[str]:
        """Return the keys that are held."""
        return [key for key, until_ns in self._until_ns.items() if now_ns < until_ns]

    def clear(self) -> None:
        """Release all keys."""
        self._until_ns.clear()

    def is_muted(self, now_ns: int) -> bool:
        """Return whether key presses are still ignored."""
        return self._muted_until_ns is not None and now_ns < self._muted_until_ns

    def mute(self, now_ns: int) -> None:
        """Release all keys and ignore further ones until there was a pause."""
        self.clear()
        self._muted_until_ns = now_ns + self._first_ns


@dataclass
class Deadman:
    """A button that enables motion while it is down, after it was seen up once."""

    seen_up: bool = False

    def held(self, down: bool) -> bool:
        """Update the button's state and return whether it counts as held."""
        self.seen_up = self.seen_up or not down
        return down and self.seen_up

    def drop(self) -> None:
        """Require a release before it counts again."""
        self.seen_up = False


class GamepadWatchdog:
    """Time without events of a gamepad, against a limit."""

    _events: int | None
    _event_ns: int

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self.update(None, 0)

    def update(self, events: int | None, now_ns: int) -> None:
        """Update the number of events so far; None without a gamepad."""
        if events is None or events != self._events:
            self._events, self._event_ns = events, now_ns

    def quiet_s(self, now_ns: int) -> float:
        """Return the time since the last event, in seconds."""
        return (now_ns - self._event_ns) / NS_PER_S

    def is_due(self, now_ns: int) -> bool:
        """Return whether the operator should move the stick to keep driving."""
        return self.quiet_s(now_ns) > self._limit_s / 2

    def is_expired(self, now_ns: int) -> bool:
        """Return whether the gamepad may no longer drive."""
        return self.quiet_s(now_ns) > self._limit_s
