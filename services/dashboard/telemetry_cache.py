"""Cache of one robot's telemetry: newest messages, events and live services.

A message that is too old is not shown: a frozen display must not look alive.
"""

from collections import defaultdict, deque
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from msgspec import Struct

from common.freshness import NS_PER_S, Latest, fresh
from common.hits import Hits
from services.dashboard.i18n import Texts, of_event, of_service, phrase
from t2 import keys
from t2.keys import Topic
from t2.messages import Event, Message, SafetyState

M = TypeVar("M", bound=Message)

EVENTS_MAX = 200  # that the page lists
HISTORY_TURNS = 4  # of ``take_new``, from the first event: the histories arrive by service
STATES_MAX = 64  # of safety: 3 s, more than any limit on an answer to one
MISSED = 4.0  # samples that may be missing before the last one is too old to show
# Names of sources and services come from the bus, where any client can invent them.
INVENTED_MAX = 30
MIN_AGE_S, MAX_AGE_S = 0.5, 3.0
STOPS_MAX = 8  # emergency stops whose names are known
AROUND_NS = 3 * NS_PER_S  # between a latch and the event that names who stopped


class EventLine(Struct, frozen=True):
    """An event as the browsers show it."""

    t: float  # s, the sender's wall clock, which may be wrong: it orders nothing
    service: Texts
    name: str
    level: str
    text: Texts


class Received(NamedTuple):
    """An event with the place on its host's own clock, which only rises; 0 is no known host."""

    host: int
    mono_ns: int
    line: EventLine


def max_age_s(topic: Topic[M]) -> float:
    """Return how long a stream's last value may be shown, in seconds."""
    return max(MIN_AGE_S, min(MAX_AGE_S, MISSED / topic.rate_hz))


@dataclass
class TelemetryCache:
    """The newest message of each stream, the events and the live services."""

    alive: dict[str, set[str]] = field(default_factory=dict)  # instances by service
    _events: deque[Received] = field(default_factory=lambda: deque(maxlen=keys.EVENTS_DEPTH))
    _hits: Hits = field(default_factory=Hits)
    _new: int = 0  # events that ``take_new`` has not returned
    _history_turns: int = HISTORY_TURNS  # left
    _last: dict[str, tuple[int, int]] = field(default_factory=dict)  # boot and seq, by service
    _states: deque[Latest[SafetyState]] = field(default_factory=lambda: deque(maxlen=STATES_MAX))
    _latest: dict[str, Latest[Message]] = field(default_factory=dict)
    _stops: deque[tuple[str, Event]] = field(default_factory=lambda: deque(maxlen=STOPS_MAX))

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

    def has_received(self, topic: Topic[M]) -> bool:
        """Return whether a stream had a message, however old."""
        return topic.path in self._latest

    @property
    def events(self) -> list[EventLine]:
        """The newest events, in the order of their arrival."""
        return [one.line for one in self._events][-EVENTS_MAX:]

    def stopped_by(self, state: SafetyState) -> str | None:
        """Return who requested the emergency stop that is latched; None if that is unknown.

        It is the event nearest to the latch, by the clock of their host, else by the wall clocks.
        """
        held = next((cause for cause in state.causes if cause.name == "estop"), None)
        if held is None or held.name not in state.latched:
            return None
        age_ns = round(held.age * NS_PER_S)
        apart = [(_apart_ns(event, state, age_ns), by) for by, event in self._stops]
        nearest_ns, by = min(apart, default=(AROUND_NS + 1, ""))
        return by if nearest_ns <= AROUND_NS else None

    def add_event(self, service: str, event: Event) -> None:
        """Store an event, and a mark where events of its service are missing before it."""
        t, by = event.t_ns / 1e9, of_service(service)
        if event.name == "estop" and isinstance(who := event.about.get("by"), str):
            self._stops.append((who, event))
        if missing := self._missing(service, event):
            mark = EventLine(t, by, "gap", "warning", phrase("events.missing", count=missing))
            self._add(event, mark)
        if not self._hits.is_repeat(service, event):
            text = of_event(service, event)
            self._add(event, EventLine(t, by, event.name, event.level, text))

    def take_new(self) -> tuple[list[EventLine], bool]:
        """Return the new events, and whether they replace all earlier ones.

        At first the histories of the services arrive, each at once: they are merged.
        """
        count, self._new = min(self._new, EVENTS_MAX), 0
        if count and self._history_turns:
            self._history_turns -= 1
            before = list(self._events)
            self._events = deque(merged(before), keys.EVENTS_DEPTH)
            if list(self._events) != before:
                return self.events, True
        return self.events[-count:] if count else [], False

    def _add(self, event: Event, shown: EventLine) -> None:
        self._events.append(Received(event.host, event.mono_ns, shown))
        self._new += 1

    def _missing(self, service: str, event: Event) -> int:
        """Return how many events of this start of a service were lost before this one."""
        boot, seq = self._last.get(service, (event.boot, event.seq))
        if service in self._last or len(self._last) < INVENTED_MAX:
            self._last[service] = event.boot, event.seq
        return max(0, event.seq - seq - 1) if boot == event.boot else 0

    def update_liveliness(self, key: str, alive: bool) -> None:
        """Handle a liveliness token that appeared or disappeared."""
        service, instance = key.split("/")[-2:]
        instances = self.alive.setdefault(service, set())
        (instances.add if alive else instances.discard)(instance)

    def services(self) -> list[str]:
        """Return the names of all services with a token or a health message so far."""
        healthy = {path.split("/")[1] for path in self._latest if path.endswith("/health")}
        return sorted(healthy | set(self.alive))


def _apart_ns(event: Event, state: SafetyState, age_ns: int) -> int:
    """Return the time between an event and what a state of safety shows with this age."""
    if event.host and event.host == state.host:
        return abs(event.mono_ns - (state.mono_ns - age_ns))
    return abs(event.t_ns - (state.t_ns - age_ns))


def merged(events: list[Received]) -> list[Received]:
    """Return the events with those of each host in the order of its clock, on the same places."""
    of_host: dict[int, list[Received]] = defaultdict(list)
    for one in events:
        of_host[one.host].append(one)
    ordered = {
        host: iter(sorted(them, key=lambda it: it.mono_ns) if host else them)
        for host, them in of_host.items()
    }
    return [next(ordered[one.host]) for one in events]


def path_of(key: str) -> str:
    """Return the part of a key below the robot."""
    return key.removeprefix(f"{keys.ROOT}/").partition("/")[2]


FIXED = frozenset(
    topic.path.format(service=service, side=side, source="", camera="")
    for topic in keys.TOPICS
    for service in keys.SERVICES
    for side in ("left", "right")
)
