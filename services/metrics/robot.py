"""State of one robot, from its messages, for the exported samples. Pure.

Only fresh values are exported, so that a dead robot does not look alive. Its absence is exported
until the robot expires.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from common.freshness import NS_PER_S, Latest, fresh
from t2 import keys
from t2.messages import Event

FRESH_S = 3.0  # a value is exported for so long: the slowest streams have 1 Hz
EXPIRY_S = 24 * 3600.0  # until an absent robot is removed: fleets change
EVENT_NAMES_MAX = 500  # further names count as "other": this bounds the memory


@dataclass(slots=True)
class RobotState:
    """Everything received from one robot; paths are those below it, as ``tel/bridge/link``."""

    messages: dict[str, Latest[Any]] = field(default_factory=dict)  # by path
    instances: dict[str, set[str]] = field(  # by liveliness, of each service, seen or not
        default_factory=lambda: {name: set() for name in keys.ON_BOARD}
    )
    events: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    is_robot: bool = False  # a robot's own service was seen, not only a laptop with its id
    seen_ns: int = 0  # last message or liveliness change

    def on_message(self, path: str, message: object, now_ns: int) -> None:
        """Handle a message of a stream, or a health message."""
        self.messages[path] = Latest(message, now_ns)
        service = path.split("/")[1]
        self.instances.setdefault(service, set())
        self._seen(service, now_ns)

    def on_live(self, service: str, instance: str, alive: bool, now_ns: int) -> None:
        """Handle a liveliness token that appeared or disappeared."""
        instances = self.instances.setdefault(service, set())
        (instances.add if alive else instances.discard)(instance)
        self._seen(service, now_ns)

    def on_event(self, service: str, event: Event) -> None:
        """Count an event."""
        key: tuple[str, str, str] = service, event.name, event.level
        if key not in self.events and len(self.events) >= EVENT_NAMES_MAX:
            key = service, "other", event.level
        self.events[key] += 1

    def fresh(self, path: str, now_ns: int) -> Any:
        """Return the newest message of a path; None without a fresh one."""
        latest = self.messages.get(path)
        return latest.value if latest and fresh(latest, now_ns, FRESH_S) else None

    def is_up(self, now_ns: int) -> bool:
        """Return whether the robot itself is alive; a laptop with its id does not count."""
        own = (path for path in self.messages if path.split("/")[1] in keys.ON_BOARD)
        return any(self.fresh(path, now_ns) for path in own)

    def is_healthy(self, service: str, now_ns: int) -> bool:
        """Return whether a service is present and its health is fresh."""
        health = self.fresh(keys.HEALTH.path.format(service=service), now_ns)
        return bool(self.instances[service]) and health is not None

    def is_expired(self, now_ns: int) -> bool:
        """Return whether the robot has been absent for ``EXPIRY_S``."""
        return not any(self.instances.values()) and now_ns - self.seen_ns > EXPIRY_S * NS_PER_S

    def _seen(self, service: str, now_ns: int) -> None:
        self.seen_ns = now_ns
        self.is_robot = self.is_robot or service in keys.ON_BOARD


def prune(robots: dict[str, RobotState], own: str, now_ns: int) -> None:
    """Remove expired robots and ids without a robot; always keep ``own``."""
    for name, robot in list(robots.items()):
        if name != own and (robot.is_expired(now_ns) or not robot.is_robot):
            del robots[name]
