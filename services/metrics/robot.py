"""What was heard of one robot, and when: fed as it comes, read by whoever draws samples. Pure.

A value is told while it is fresh. What is older is left out, so that a robot that is gone does not
look alive; its age and its absence are told instead, until it is forgotten.
"""

from bisect import bisect_left
from collections import Counter
from dataclasses import dataclass, field
from math import isfinite

from common.freshness import NS_PER_S, Latest, fresh
from common.messages import Event, Health, Link, Odometry, SafetyState

WORTH_S = 3.0  # how long a value is told: the slowest streams come once a second
KEPT_S = 24 * 3600.0  # after which what is gone is forgotten: fleets change
EXPECTED = ("bridge", "safety", "odom")  # it does not drive without: told though never heard
NAMES = 500  # events of so many names are told apart: nobody fills the memory with invented ones
ROOM = ("disk_full", "disk_room")  # the recorder's events that tell whether it can write
LATENESS_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


@dataclass(slots=True)
class Tally:
    """A histogram over ``LATENESS_S``: what comes between two scrapes is not lost."""

    counts: list[int] = field(default_factory=lambda: [0] * (len(LATENESS_S) + 1))
    total: float = 0.0  # s

    def add(self, late_s: float) -> None:
        """Count one; what is no number is none."""
        if isfinite(late_s):
            self.counts[bisect_left(LATENESS_S, late_s)] += 1
            self.total += late_s


@dataclass(slots=True)
class Service:
    """One service of a robot."""

    instances: set[str] = field(default_factory=set)  # by liveliness
    health: Latest[Health] | None = None
    lateness: Tally = field(default_factory=Tally)
    seen_ns: int = 0  # when it was last heard, or came or went

    def is_well(self, now_ns: int) -> bool:
        """Tell whether it is there and its loop turns."""
        return bool(self.instances) and fresh(self.health, now_ns, WORTH_S)


@dataclass(slots=True)
class Robot:
    """Everything that was heard of one robot."""

    services: dict[str, Service] = field(
        default_factory=lambda: {name: Service() for name in EXPECTED}
    )
    safety: Latest[SafetyState] | None = None
    link: Latest[Link] | None = None
    odometry: Latest[Odometry] | None = None
    events: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    room: Event | None = None  # the recorder's last word on its disk

    def on_health(self, name: str, health: Health, now_ns: int) -> None:
        """Take in what a service tells of itself."""
        service = self._service(name, now_ns)
        service.health = Latest(health, now_ns)
        service.lateness.add(health.lateness)

    def on_live(self, name: str, instance: str, alive: bool, now_ns: int) -> None:
        """Take in a liveliness token that appeared or went."""
        instances = self._service(name, now_ns).instances
        (instances.add if alive else instances.discard)(instance)

    def on_event(self, name: str, event: Event) -> None:
        """Count an event; late ones come in any order."""
        key = name, event.name, event.level
        if key not in self.events and len(self.events) >= NAMES:
            key = name, "other", event.level
        self.events[key] += 1
        newer = self.room is None or event.t_ns > self.room.t_ns
        if name == "recorder" and event.name in ROOM and newer:
            self.room = event

    @property
    def is_robot(self) -> bool:
        """Whether anything that runs on a robot was ever heard: others only bear its id."""
        streams = self.safety, self.link, self.odometry
        return any(streams) or any(self.services[name].seen_ns for name in EXPECTED)

    def is_up(self, now_ns: int) -> bool:
        """Tell whether what runs on the robot itself is heard: others bear its id on laptops."""
        heard = [each.received_ns for each in (self.safety, self.link, self.odometry) if each]
        lately = any(now_ns - received_ns <= WORTH_S * NS_PER_S for received_ns in heard)
        return lately or any(self.services[name].is_well(now_ns) for name in EXPECTED)

    def no_room(self) -> bool:
        """Tell whether the recorder that runs has said that its disk takes no more."""
        recorder = self.services.get("recorder")
        if recorder is None or recorder.health is None or self.room is None:
            return False
        same = self.room.boot == recorder.health.value.boot
        return same and self.room.name == "disk_full"

    def forget(self, now_ns: int) -> bool:
        """Forget services that are long gone; tell whether nothing is left of the robot."""
        for name, service in list(self.services.items()):
            gone = not service.instances and now_ns - service.seen_ns > KEPT_S * NS_PER_S
            if gone and name not in EXPECTED:
                del self.services[name]
        streams = [each.received_ns for each in (self.safety, self.link, self.odometry) if each]
        seen_ns = max([*streams, *(each.seen_ns for each in self.services.values())])
        present = any(each.instances for each in self.services.values())
        return not present and now_ns - seen_ns > KEPT_S * NS_PER_S

    def _service(self, name: str, now_ns: int) -> Service:
        service = self.services.setdefault(name, Service())
        service.seen_ns = now_ns
        return service


def prune(robots: dict[str, Robot], own: str, now_ns: int) -> None:
    """Forget what is long gone, and who only bears an id; of ``own`` the robot itself is kept."""
    for name, robot in list(robots.items()):
        gone = robot.forget(now_ns)
        if name != own and (gone or not robot.is_robot):
            del robots[name]
