"""State of one robot, from its messages, for the exported samples. Pure.

Only fresh values are exported, so that a dead robot does not look alive. Its absence is exported
until the robot expires.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from common.freshness import NS_PER_S, Latest, fresh
from common.messages import Event

FRESH_S = 3.0  # a value is exported for so long: the slowest streams have 1 Hz
EXPIRY_S = 24 * 3600.0  # until a silent robot is removed: fleets change
EXPECTED = ("bridge", "safety", "odom")  # needed to drive: exported even if never seen
EVENT_NAMES_MAX = 500  # further names count as "other": this bounds the memory


@dataclass(slots=True)
class RobotState:
    """Everything received from one robot; paths are those below it, as ``tel/bridge/link``."""

    messages: dict[str, Latest[Any]] = field(default_factory=dict)  # by path
    events: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    services: set[str] = field(default_factory=lambda: set(EXPECTED))
    is_robot: bool = False  # a robot's own service was seen, not only a laptop with its id
    seen_ns: int = 0  # last message

    def on_message(self, path: str, message: object, now_ns: int) -> None:
        """Handle a message of a stream, or a health message."""
        self.messages[path] = Latest(message, now_ns)
        service = path.split("/")[1]
        self.services.add(service)
        self.is_robot = self.is_robot or service in EXPECTED
        self.seen_ns = now_ns

    def on_event(self, service: str, event: Event) -> None:
        """Count an event."""
        key = service, event.name, event.level
        if key not in self.events and len(self.events) >= EVENT_NAMES_MAX:
            key = service, "other", event.level
        self.events[key] += 1

    def fresh(self, path: str, now_ns: int) -> Any:
        """Return the newest message of a path; None without a fresh one."""
        latest = self.messages.get(path)
        return latest.value if latest and fresh(latest, now_ns, FRESH_S) else None

    def is_up(self, now_ns: int) -> bool:
        """Return whether the robot itself is alive; a laptop with its id does not count."""
        own = (path for path in self.messages if path.split("/")[1] in EXPECTED)
        return any(self.fresh(path, now_ns) for path in own)


def prune(robots: dict[str, RobotState], own: str, now_ns: int) -> None:
    """Remove expired robots and ids without a robot; always keep ``own``."""
    for name, robot in list(robots.items()):
        is_expired = now_ns - robot.seen_ns > EXPIRY_S * NS_PER_S
        if name != own and (is_expired or not robot.is_robot):
            del robots[name]
