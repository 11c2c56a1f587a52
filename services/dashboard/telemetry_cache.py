"""What was heard of one robot: the newest message of each stream with its age, and who is alive.

What is older than it is worth is not shown: a picture that stands still must not look alive.
"""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import TypeVar

from common import keys
from common.freshness import NS_PER_S, Latest, fresh
from common.keys import Topic
from common.messages import Event, Message

M = TypeVar("M", bound=Message)

EVENTS_KEPT = 80
MISSED = 4.0  # samples that may be missing before the last one is too old to show
# Names of sources and services come from the bus, where any client can invent them.
MADE_UP_KEPT = 30
OTHERS = "others"  # the entry of all further ones
WILD = {"service": "*", "side": "*", "source": "*"}
COUNTED_S = 3.0  # over which rates are counted: streams of 1 Hz are to stand still
WORTH_MIN_S, WORTH_MAX_S = 0.5, 3.0


@dataclass(frozen=True, slots=True)
class Line:
    """An event, and who told it."""

    service: str
    event: Event


def worth_s(topic: Topic[M]) -> float:
    """Return how long a stream's last value may be shown, in seconds."""
    return max(WORTH_MIN_S, min(WORTH_MAX_S, MISSED / topic.rate_hz))


@dataclass
class Heard:
    """The newest of everything; fed as it comes, read with the time of the reading."""

    alive: dict[str, set[str]] = field(default_factory=dict)  # instances by service
    events: deque[Line] = field(default_factory=lambda: deque(maxlen=EVENTS_KEPT))
    told: int = 0  # events so far
    rates: dict[str, float] = field(default_factory=dict)  # Hz by path, over COUNTED_S
    _made_up: int = 0  # entries that are not ``FIXED``
    _latest: dict[str, Latest[Message]] = field(default_factory=dict)
    _counts: Counter[str] = field(default_factory=Counter)  # messages so far, by path
    _counted: deque[tuple[int, Counter[str]]] = field(default_factory=deque)  # when, and how many

    def hear(self, path: str, message: Message, received_ns: int) -> None:
        """Take a message of the stream with this path below the robot's key."""
        if path not in self._latest and path not in FIXED:
            path = OTHERS if self._made_up >= MADE_UP_KEPT else path
            self._made_up += path is not OTHERS
        self._latest[path] = Latest(message, received_ns)
        self._counts[path] += 1

    def newest(self, topic: Topic[M], now_ns: int, **names: str) -> M | None:
        """Return a stream's newest message, or None once it is older than it is worth."""
        latest = self._latest.get(topic.path.format(**names))
        if latest is None or not fresh(latest, now_ns, worth_s(topic)):
            return None
        return latest.value if isinstance(latest.value, topic.message) else None

    def ages_s(self, now_ns: int) -> dict[str, float]:
        """Return how old the newest message of each stream is, by path."""
        return {path: latest.age_s(now_ns) for path, latest in sorted(self._latest.items())}

    def count(self, now_ns: int) -> None:
        """Take the rates anew; call it now and then."""
        while len(self._counted) > 1 and now_ns - self._counted[1][0] >= COUNTED_S * NS_PER_S:
            self._counted.popleft()
        if self._counted:
            since_ns, before = self._counted[0]
            past_s = (now_ns - since_ns) / NS_PER_S
            self.rates = {path: count / past_s for path, count in (self._counts - before).items()}
        self._counted.append((now_ns, self._counts.copy()))

    def note(self, service: str, event: Event) -> None:
        """Keep an event; a late one takes its place by the time of its sender."""
        self.events.append(Line(service, event))
        ordered = sorted(self.events, key=lambda line: line.event.t_ns)
        self.events.clear()
        self.events.extend(ordered)
        self.told += 1

    def lives(self, key: str, alive: bool) -> None:
        """Take a liveliness token that appeared or went."""
        service, instance = key.split("/")[-2:]
        instances = self.alive.setdefault(service, set())
        (instances.add if alive else instances.discard)(instance)

    def services(self) -> list[str]:
        """Return every service that was ever seen or heard, by name."""
        healthy = {path.split("/")[1] for path in self._latest if path.endswith("/health")}
        return sorted(healthy | set(self.alive))


def path_of(key: str) -> str:
    """Return what stands behind the robot in a key."""
    return key.removeprefix(f"{keys.ROOT}/").partition("/")[2]


FIXED = frozenset(path_of(key) for topic in keys.TOPICS for key in topic.known("", WILD, ()))
