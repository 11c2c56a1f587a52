"""Selection of the messages to replay. Pure.

Onto a bus, ``t2 replay`` never plays what moves or stops the vehicle: no drive request, no motion
command and no emergency stop.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from common import keys
from common.freshness import NS_PER_S

DECIDING = ("bridge", "safety")  # services that act, and on whose messages others act


def moves(path: str) -> bool:
    """Return whether a key below the robot moves or stops the vehicle."""
    return path == keys.ESTOP_PATH or any(part.startswith("@") for part in path.split("/"))


def publisher(path: str) -> str:
    """Return the service that publishes a stream or an event; empty for other keys."""
    kind, _, rest = path.partition("/")
    return rest.partition("/")[0] if kind in ("tel", "evt") else ""


def refusal(robot: str, alive: Collection[str]) -> str:
    """Return why a replay is refused while these services run; empty if it is allowed."""
    running = [name for name in DECIDING if name in alive]
    if not running:
        return ""
    are, own, them = ("is", "its", "it") if len(running) == 1 else ("are", "their", "them")
    return (
        f"{' and '.join(running)} of robot {robot} {are} running: replayed messages would be taken "
        f"for {own} own. Stop {them}, or replay as another robot: --robot replay"
    )


@dataclass(slots=True)
class Selection:
    """The messages to play; times in seconds since the start of the recording."""

    matches: Callable[[str, str], bool]  # a key expression and a key below the robot
    only: Collection[str] = ()  # key expressions below the robot; empty means all
    skip: Collection[str] = ()
    from_s: float = 0.0
    to_s: float | None = None
    alive: Collection[str] = ()  # running services: their streams are not played
    frames: bool = False  # to a bridge, not onto a bus
    _begin_ns: int | None = None
    _known: dict[str, bool] = field(default_factory=dict)

    def includes(self, path: str, log_ns: int) -> bool:
        """Return whether to play a message; the first call sets the start of the recording."""
        if self._begin_ns is None:
            self._begin_ns = log_ns
        at_s = (log_ns - self._begin_ns) / NS_PER_S
        if at_s < self.from_s or (self.to_s is not None and at_s > self.to_s):
            return False
        if path not in self._known:
            self._known[path] = self._is_allowed(path) and self._is_selected(path)
        return self._known[path]

    def is_over(self, log_ns: int) -> bool:
        """Return whether no later message can be included."""
        if self.to_s is None or self._begin_ns is None:
            return False
        return log_ns - self._begin_ns > self.to_s * NS_PER_S

    def _is_allowed(self, path: str) -> bool:
        return self.frames or not (moves(path) or publisher(path) in self.alive)

    def _is_selected(self, path: str) -> bool:
        wanted = not self.only or any(self.matches(each, path) for each in self.only)
        return wanted and not any(self.matches(each, path) for each in self.skip)
