"""State of one robot, from its messages, for the exported samples. Pure.

Only fresh values are exported, so that a dead robot does not look alive. Its age and its absence
are exported until the robot expires.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from common.freshness import NS_PER_S, Latest, fresh
from common.messages import Event, Health, Message

FRESH_S = 3.0  # a value is exported for so long: the slowest streams have 1 Hz
EXPIRY_S = 24 * 3600.0  # until an absent robot is removed: fleets change
EXPECTED = ("bridge", "safety", "odom")  # needed to drive: exported even if never seen
EVENT_NAMES_MAX = 500  # further names count as "other": this bounds the memory
DISK_EVENTS = ("disk_full", "disk_room")  # of the recorder


@dataclass(slots=True)
class ServiceState:
    """One service of a robot."""

    instances: set[str] = field(default_factory=set)  # by liveliness
    health: Latest[Health] | None = None
    seen_ns: int = 0  # last message or liveliness change

    def is_healthy(self, now_ns: int) -> bool:
        """Return whether it is present and its health is fresh."""
        return bool(self.instances) and fresh(self.health, now_ns, FRESH_S)


@dataclass(slots=True)
class RobotState:
    """Everything received from one robot."""

    services: dict[str, ServiceState] = field(
        default_factory=lambda: {name: ServiceState() for name in EXPECTED}
    )
    streams: dict[type[Message], Latest[Any]] = field(default_factory=dict)  # by message
    events: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    disk: Event | None = None  # the recorder's latest disk event

    def on_health(self, name: str, health: Health, now_ns: int) -> None:
        """Handle a health message."""
        self._service(name, now_ns).health = Latest(health, now_ns)

    def on_live(self, name: str, instance: str, alive: bool, now_ns: int) -> None:
        """Handle a liveliness token that appeared or disappeared."""
        instances = self._service(name, now_ns).instances
        (instances.add if alive else instances.discard)(instance)

    def on_event(self, name: str, event: Event) -> None:
        """Count an event; replayed events may arrive in any order."""
        key = name, event.name, event.level
        if key not in self.events and len(self.events) >= EVENT_NAMES_MAX:
            key = name, "other", event.level
        self.events[key] += 1
        newer = self.disk is None or event.t_ns > self.disk.t_ns
        if name == "recorder" and event.name in DISK_EVENTS and newer:
            self.disk = event

    @property
    def is_robot(self) -> bool:
        """Return whether a service of a robot was ever seen, not only a laptop with its id."""
        return bool(self.streams) or any(self.services[name].seen_ns for name in EXPECTED)

    def is_up(self, now_ns: int) -> bool:
        """Return whether the robot itself is alive; a laptop with its id does not count."""
        is_fresh = any(fresh(latest, now_ns, FRESH_S) for latest in self.streams.values())
        return is_fresh or any(self.services[name].is_healthy(now_ns) for name in EXPECTED)

    def disk_full(self) -> bool:
        """Return whether the running recorder has reported a full disk."""
        recorder = self.services.get("recorder")
        if recorder is None or recorder.health is None or self.disk is None:
            return False
        same_process = self.disk.boot == recorder.health.value.boot
        return same_process and self.disk.name == "disk_full"

    def is_expired(self, now_ns: int) -> bool:
        """Return whether the robot has been absent for ``EXPIRY_S``."""
        received = [latest.received_ns for latest in self.streams.values()]
        seen_ns = max([*received, *(each.seen_ns for each in self.services.values())])
        present = any(each.instances for each in self.services.values())
        return not present and now_ns - seen_ns > EXPIRY_S * NS_PER_S

    def _service(self, name: str, now_ns: int) -> ServiceState:
        service = self.services.setdefault(name, ServiceState())
        service.seen_ns = now_ns
        return service


def prune(robots: dict[str, RobotState], own: str, now_ns: int) -> None:
    """Remove expired robots and ids without a robot; always keep ``own``."""
    for name, robot in list(robots.items()):
        if name != own and (robot.is_expired(now_ns) or not robot.is_robot):
            del robots[name]
