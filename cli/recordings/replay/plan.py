"""What of a recording is played, and what is not. Pure.

Nothing that moves wheels is played: neither requests nor motion, nor an emergency stop. Aimed at a
simulated vehicle by name, the requests and the stops alone are played, to the safety service that
is there; what safety made of them at that time never is.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Literal

from common import keys
from common.freshness import NS_PER_S

Aim = Literal["bus", "simulator", "board"]

DECIDING = ("bridge", "safety")  # whose words others act on, and which act themselves
DRIVE = keys.DRIVE.path.partition("{")[0]


def moves(path: str) -> bool:
    """Tell whether a key below the robot is one that moves or stops the wheels."""
    return path == keys.ESTOP_PATH or any(part.startswith("@") for part in path.split("/"))


def speaker(path: str) -> str:
    """Return the service whose word a stream or an event is; nothing for other keys."""
    kind, _, rest = path.partition("/")
    return rest.partition("/")[0] if kind in ("tel", "evt") else ""


def refusal(robot: str, alive: Collection[str]) -> str:
    """Say why nothing may be played onto a robot's keys while these services live; or nothing."""
    there = [name for name in DECIDING if name in alive]
    if not there:
        return ""
    return (
        f"{' and '.join(there)} of robot {robot} is there: what is replayed would be taken for its "
        "word. End it, or replay as another robot: --robot replay"
    )


@dataclass(slots=True)
class Choice:
    """Which messages are played; times in seconds from the beginning of the recording."""

    aim: Aim
    matches: Callable[[str, str], bool]  # a key expression and a key below the robot
    only: Collection[str] = ()  # key expressions below the robot; none means all
    skip: Collection[str] = ()
    from_s: float = 0.0
    to_s: float | None = None
    alive: Collection[str] = ()  # services that speak for themselves
    _begin_ns: int | None = None
    _known: dict[str, bool] = field(default_factory=dict)

    def takes(self, path: str, log_ns: int) -> bool:
        """Tell whether a message is played; the first one that is asked about is the beginning."""
        if self._begin_ns is None:
            self._begin_ns = log_ns
        at_s = (log_ns - self._begin_ns) / NS_PER_S
        if at_s < self.from_s or (self.to_s is not None and at_s > self.to_s):
            return False
        if path not in self._known:
            self._known[path] = self._aimed(path) and self._wanted(path)
        return self._known[path]

    def is_over(self, log_ns: int) -> bool:
        """Tell whether nothing follows that would be played."""
        if self.to_s is None or self._begin_ns is None:
            return False
        return log_ns - self._begin_ns > self.to_s * NS_PER_S

    def _aimed(self, path: str) -> bool:
        if self.aim == "simulator":
            return path == keys.ESTOP_PATH or path.startswith(DRIVE)
        return self.aim == "board" or not (moves(path) or speaker(path) in self.alive)

    def _wanted(self, path: str) -> bool:
        asked_for = not self.only or any(self.matches(each, path) for each in self.only)
        return asked_for and not any(self.matches(each, path) for each in self.skip)
