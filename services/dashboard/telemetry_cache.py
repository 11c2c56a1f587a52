"""Cache of one robot's telemetry: newest messages, events and live services.

A message that is too old is not shown: a frozen display must not look alive.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import TypeVar

from msgspec import Struct

from common import keys
from common.freshness import Latest, fresh
from common.keys import Topic
from common.messages import Event, Message, SafetyState
from common.text import line

M = TypeVar("M", bound=Message)

EVENTS_MAX = 80
STATES_MAX = 64  # of safety: 3 s, more than any limit on an answer to one
MISSED = 4.0  # samples that may be missing before the last one is too old to show
# Names of sources and services come from the bus, where any client can invent them.
INVENTED_MAX = 30
MIN_AGE_S, MAX_AGE_S = 0.5, 3.0


class EventLine(Struct, frozen=True):
    """An event as the browsers show it."""

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
    new_events: deque[EventLine] = field(default_factory=lambda: deque(maxlen=EVENTS_MAX))
    _states: deque[Latest[SafetyState]] = field(default_factory=lambda: deque(maxlen=STATES_MAX))
    _latest: dict[str, Latest[Message]] = field(default_factory=dict)

    def update(self, path: str, message: Message, received_ns: int) -> None:
        """Store a message of the stream with this path below the robot's key."""
        is_known = path in FIXED or path in self._latest
        if not is_known and len(self._latest) >= len(FIXED) + INVENTED_MAX:
            return
        self._latest[path] = Latest(message, received_ns)
        if isinstance(message, SafetyState):
            self._states.append(Latest(message, received_ns))

    def shown(self, heartbeat: int) -> Latest[SafetyState] | None:
        """Return the state of safety with this heartbeat; None if it is unknown or too old."""
        return next((one for one in self._states if one.value.heartbeat == heartbeat), None)

    def newest(self, topic: Topic[M], now_ns: int, **names: str) -> M | None:
        """Return a stream's newest message, or None once it is too old."""
        latest = self._latest.get(topic.path.format(**names))
        if latest is None or not fresh(latest, now_ns, max_age_s(topic)):
            return None
        return latest.value if isinstance(latest.value, topic.message) else None

    def add_event(self, service: str, event: Event) -> None:
        """Store an event, sorted by the sender's time."""
        t = event.t_ns / 1e9
        added = EventLine(t, service, event.name, event.level, line(event.text))
        self.new_events.append(added)
        ordered = sorted([*self.events, added], key=lambda each: each.t)
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


def path_of(key: str) -> str:
    """Return the part of a key below the robot."""
    return key.removeprefix(f"{keys.ROOT}/").partition("/")[2]


FIXED = frozenset(
    topic.path.format(service=service, side=side, source="")
    for topic in keys.TOPICS
    for service in keys.SERVICES
    for side in ("left", "right")
)
