"""Summary of a recording, for ``t2 info``. Pure."""

from collections import Counter
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from common.messages import Event, Health, Message, SafetyState
from services.recorder.blackbox import LatchDetector


@dataclass(slots=True)
class Stream:
    """Statistics of one key."""

    kind: str
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    raw: int = 0  # messages with a raw frame attached

    @property
    def hz(self) -> float | None:
        """Return the mean rate; None for a single message."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) * NS_PER_S / span_ns if span_ns > 0 else None


@dataclass(frozen=True, slots=True)
class Note:
    """An event or a latch."""

    at_s: float  # since the first message
    service: str
    level: str
    text: str


@dataclass(slots=True)
class Summary:
    """Totals of a recording, updated message by message."""

    begin_ns: int | None = None  # on the recorder's wall clock
    end_ns: int = 0
    streams: dict[str, Stream] = field(default_factory=dict)  # by key
    events: list[Note] = field(default_factory=list)
    latched: list[Note] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)  # by service
    faulty: Counter[str] = field(default_factory=Counter)  # invalid messages, by key
    _latches: LatchDetector = field(default_factory=LatchDetector)

    @property
    def duration_s(self) -> float:
        """Return the time from the first message to the last."""
        return (self.end_ns - (self.begin_ns or self.end_ns)) / NS_PER_S

    @property
    def messages(self) -> int:
        """Return the number of messages."""
        return sum(stream.count for stream in self.streams.values())

    def add(self, key: str, kind: str, message: Message | None, log_ns: int, *, raw: bool) -> None:
        """Add the next message; None for an unknown type or an invalid message."""
        if self.begin_ns is None:
            self.begin_ns = log_ns
        self.end_ns = max(self.end_ns, log_ns)
        stream = self.streams.setdefault(key, Stream(kind, first_ns=log_ns))
        stream.count, stream.last_ns = stream.count + 1, log_ns
        stream.raw += raw
        if kind and message is None:
            self.faulty[key] += 1
        self._note(key, message, (log_ns - self.begin_ns) / NS_PER_S)

    def _note(self, key: str, message: Message | None, at_s: float) -> None:
        match message:
            case Event():
                text = f"{message.name}: {message.text}"
                self.events.append(Note(at_s, key.rpartition("/")[2], message.level, text))
            case Health():
                self.versions[key.split("/")[-2]] = message.version
            case SafetyState():
                for name in self._latches.update(message):
                    self.latched.append(Note(at_s, "safety", "error", name))
