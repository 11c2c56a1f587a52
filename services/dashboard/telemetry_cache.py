"""Cache of one robot's telemetry: newest messages, events, live services and the trajectory.

A message that is too old is not shown: a frozen display must not look alive.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import TypeVar

from msgspec import Struct

from common import keys
from common.freshness import NS_PER_S, Latest, fresh
from common.keys import Topic
from common.messages import Event, Message
from common.text import printable

M = TypeVar("M", bound=Message)

EVENTS_MAX = 80
MISSED = 4.0  # samples that may be missing before the last one is too old to show
# Names of sources and services come from the bus, where any client can invent them.
UNKNOWN_MAX = 30
OTHERS = "others"  # the entry of all further ones
WILDCARDS = {"service": "*", "side": "*", "source": "*"}
RATE_WINDOW_S = 3.0  # long enough for a constant rate of 1 Hz streams
MIN_AGE_S, MAX_AGE_S = 0.5, 3.0
SPACING_M = 0.05  # between two points of the trail
POINTS = 4000


class EventLine(Struct, frozen=True):
    """An event as the browsers show it."""

    n: int  # rises with each event that was received
    t: float  # s, the sender's wall clock
    service: str
    name: str
    level: str
    text: str


def max_age_s(topic: Topic[M]) -> float:
    """Return how long a stream's last value may be shown, in seconds."""
    return max(MIN_AGE_S, min(MAX_AGE_S, MISSED / topic.rate_hz))


@dataclass
class TelemetryCache:
    """The newest message of each stream, the events and the live services."""

    alive: dict[str, set[str]] = field(default_factory=dict)  # instances by service
    events: deque[EventLine] = field(default_factory=lambda: deque(maxlen=EVENTS_MAX))
    event_count: int = 0  # events so far
    rates: dict[str, float] = field(default_factory=dict)  # Hz by path, over RATE_WINDOW_S
    _unknown: int = 0  # entries that are not in ``FIXED``
    _latest: dict[str, Latest[Message]] = field(default_factory=dict)
    _counts: Counter[str] = field(default_factory=Counter)  # messages so far, by path
    _history: deque[tuple[int, Counter[str]]] = field(default_factory=deque)  # time and counts

    def update(self, path: str, message: Message, received_ns: int) -> None:
        """Store a message of the stream with this path below the robot's key."""
        if path not in self._latest and path not in FIXED:
            path = OTHERS if self._unknown >= UNKNOWN_MAX else path
            self._unknown += path is not OTHERS
        self._latest[path] = Latest(message, received_ns)
        self._counts[path] += 1

    def newest(self, topic: Topic[M], now_ns: int, **names: str) -> M | None:
        """Return a stream's newest message, or None once it is too old."""
        latest = self._latest.get(topic.path.format(**names))
        if latest is None or not fresh(latest, now_ns, max_age_s(topic)):
            return None
        return latest.value if isinstance(latest.value, topic.message) else None

    def ages_s(self, now_ns: int) -> dict[str, float]:
        """Return the age of the newest message of each stream, by path."""
        return {path: latest.age_s(now_ns) for path, latest in sorted(self._latest.items())}

    def update_rates(self, now_ns: int) -> None:
        """Recompute the rates; call it periodically."""
        while len(self._history) > 1 and now_ns - self._history[1][0] >= RATE_WINDOW_S * NS_PER_S:
            self._history.popleft()
        if self._history:
            since_ns, before = self._history[0]
            past_s = (now_ns - since_ns) / NS_PER_S
            self.rates = {path: count / past_s for path, count in (self._counts - before).items()}
        self._history.append((now_ns, self._counts.copy()))

    def add_event(self, service: str, event: Event) -> None:
        """Store an event, sorted by the sender's time."""
        self.event_count += 1
        t, text = event.t_ns / 1e9, printable(event.text)
        line = EventLine(self.event_count, t, service, event.name, event.level, text)
        ordered = sorted([*self.events, line], key=lambda line: line.t)
        self.events.clear()
        self.events.extend(ordered)

    def update_liveliness(self, key: str, alive: bool) -> None:
        """Handle a liveliness token that appeared or disappeared."""
        service, instance = key.split("/")[-2:]
        instances = self.alive.setdefault(service, set())
        (instances.add if alive else instances.discard)(instance)

    def services(self) -> list[str]:
        """Return the names of all services with a token or a health message so far."""
        healthy = {path.split("/")[1] for path in self._latest if path.endswith("/health")}
        return sorted(healthy | set(self.alive))


@dataclass
class Trail:
    """The trajectory in ``odom``, metres: downsampled by distance, bounded, one odometry epoch."""

    points: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=POINTS))
    epoch: int | None = None

    def add(self, x: float, y: float, epoch: int) -> bool:
        """Add a point if it is far enough from the last; return whether a new epoch began."""
        is_new = self.epoch is not None and epoch != self.epoch
        if is_new:
            self.points.clear()
        self.epoch = epoch
        if not self.points or math.dist(self.points[-1], (x, y)) >= SPACING_M:
            self.points.append((round(x, 3), round(y, 3)))
        return is_new

    def begin(self, earlier: list[tuple[float, float]], epoch: int) -> None:
        """Prepend the points that odometry has stored before."""
        if self.epoch in (None, epoch):
            self.epoch = epoch
            since = list(self.points)
            self.points.clear()
            self.points.extend([*earlier, *since])


def path_of(key: str) -> str:
    """Return the part of a key below the robot."""
    return key.removeprefix(f"{keys.ROOT}/").partition("/")[2]


FIXED = frozenset(path_of(key) for topic in keys.TOPICS for key in topic.known("", WILDCARDS, ()))
