"""Hold to drive: which keys are held, and whether a gamepad counts.

**Keys.** A terminal sends a key when it goes down and again while it stays down, but nothing when
it comes up. A key is therefore held until a deadline: ``first`` seconds after it came out of the
blue (the first repeat takes a terminal about half a second) and ``repeat`` seconds after each
repeat. After the bus was lost, keys count only once none has come for ``first`` seconds: what is
still held then is an old wish.

**Deadman.** A gamepad's button tells both ways, but it counts only after it was seen up: one that
is down when the gamepad is found, or after a stop, must be let go first.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from common.freshness import NS_PER_S
from common.messages import SafetyState


@dataclass(frozen=True, slots=True)
class Press:
    """A key press or its repeat, as the screen took it from the terminal."""

    key: str
    at_ns: int  # when it was read
    shown: SafetyState | None = None  # what the screen showed then

    def age_s(self, now_ns: int) -> float:
        """Return how long it has waited."""
        return (now_ns - self.at_ns) / NS_PER_S


class Keys:
    """Which keys are held, by deadlines."""

    def __init__(self, first_s: float, repeat_s: float) -> None:
        self._first_ns = round(first_s * NS_PER_S)
        self._repeat_ns = round(repeat_s * NS_PER_S)
        self._until_ns: dict[str, int] = {}
        self._muted_until_ns: int | None = None

    def press(self, key: str, now_ns: int) -> None:
        """Take a key press or its repeat; a terminal does not tell which."""
        if self._muted_until_ns is not None and now_ns < self._muted_until_ns:
            self.mute(now_ns)
            return
        hold_ns = self._repeat_ns if key in self.held(now_ns) else self._first_ns
        self._until_ns[key] = now_ns + hold_ns

    def press_alone(self, key: str, now_ns: int) -> None:
        """Take a key press or its repeat, and release every other key."""
        self._until_ns = {held: at for held, at in self._until_ns.items() if held == key}
        self.press(key, now_ns)

    def held(self, now_ns: int) -> Iterable[str]:
        """Return the keys that are held."""
        return [key for key, until_ns in self._until_ns.items() if now_ns < until_ns]

    def clear(self) -> None:
        """Let all of them go."""
        self._until_ns.clear()

    def mute(self, now_ns: int) -> None:
        """Let all of them go, and let none count before there was silence."""
        self.clear()
        self._muted_until_ns = now_ns + self._first_ns


class Deadman:
    """A button that drives while it is down, once it has been seen up."""

    def __init__(self) -> None:
        self._seen_up = False

    def held(self, down: bool) -> bool:
        """Take the button's state and tell whether it counts."""
        self._seen_up = self._seen_up or not down
        return down and self._seen_up

    def drop(self) -> None:
        """Want it let go before it counts again."""
        self._seen_up = False
