"""Timeline of a recording, for ``t2 info`` and ``t2 report``: series, paths, stops, events. Pure.

A stop begins with the first cause that stops the vehicle and ends when none is left. ``no_request``
and ``neutral`` do not count: the vehicle stands because nothing requests motion, or because the
controls must be let go first.

Times are seconds since the recording's first message, on the recorder's wall clock. A series holds
NaN in a gap, so that no line is drawn through it.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise

from cli.inspect.addressing import chunks, topic_of
from cli.recordings.latch_pictures import LatchPictures
from cli.recordings.path import MapTrack, PathSegment, segment_of
from common.freshness import NS_PER_S
from t2 import keys
from t2.messages import (
    Cause,
    Drive,
    Event,
    Health,
    Message,
    Motion,
    Odometry,
    SafetyState,
    Velocity,
)

NAN = math.nan
GAP_S = 0.5  # the slowest plotted stream has 20 Hz
MISSED = 3.0  # a gap is longer than this many periods
IDLE = {"no_request", "neutral"}


# --- verdicts and stops --------------------------------------------------------------------------


@dataclass(slots=True)
class Phase:
    """A period of a constant verdict; ``state`` is its first message."""

    begins_s: float
    ends_s: float
    state: SafetyState

    def is_same(self, state: SafetyState) -> bool:
        """Return whether a state differs in nothing that a report shows."""
        first = self.state
        names = [[cause.name for cause in each.causes] for each in (first, state)]
        return first.verdict == state.verdict and names[0] == names[1]


@dataclass(slots=True)
class Stop:
    """A stop of the vehicle."""

    begins_s: float
    ends_s: float
    was_driving: bool  # the vehicle moved before
    verdict: str  # the first one
    reasons: dict[str, Cause] = field(default_factory=dict)  # by name, in order of appearance

    @property
    def lasts_s(self) -> float:
        """Return the duration."""
        return self.ends_s - self.begins_s


def add_state(phases: list[Phase], at_s: float, state: SafetyState, gap_s: float) -> None:
    """Add a state to consecutive phases; a phase ends after ``gap_s`` without a message."""
    last = phases[-1] if phases else None
    if last is not None and at_s - last.ends_s <= gap_s:
        last.ends_s = at_s  # a phase that ends lasts until the next state
        if last.is_same(state):
            return
    phases.append(Phase(at_s, at_s, state))


def stops(phases: Iterable[Phase]) -> list[Stop]:
    """Return all stops of a recording."""
    found: list[Stop] = []
    current: Stop | None = None
    driving = False
    for phase in phases:
        causes = stopping_causes(phase.state)
        if current is not None and (not causes or phase.begins_s > current.ends_s):
            current = None
        if causes and current is None:
            current = Stop(phase.begins_s, phase.ends_s, driving, phase.state.verdict)
            found.append(current)
        if current is not None:
            current.ends_s = phase.ends_s
            for cause in causes:
                current.reasons.setdefault(cause.name, cause)
        driving = phase.state.verdict in ("run", "slow")
    return found


def stopping_causes(state: SafetyState) -> list[Cause]:
    """Return the causes that stop the vehicle, without those of an idle vehicle."""
    if state.verdict in ("run", "slow"):
        return []
    return [cause for cause in state.causes if cause.action != "slow" and cause.name not in IDLE]


# --- series and streams --------------------------------------------------------------------------


@dataclass(slots=True)
class Series:
    """A time series."""

    times: list[float] = field(default_factory=list)  # s
    values: list[float] = field(default_factory=list)

    def add(self, at_s: float, value: float) -> None:
        """Add a value; mark a gap before it with NaN."""
        if self.times and at_s - self.times[-1] > GAP_S:
            self.times.append(self.times[-1])
            self.values.append(NAN)
        self.times.append(at_s)
        self.values.append(value)


@dataclass(slots=True)
class VelocitySeries:
    """One component of the velocity: requested, allowed and measured; m/s or rad/s."""

    requested: dict[str, Series] = field(default_factory=dict)  # by source
    allowed: Series = field(default_factory=Series)  # by safety
    measured: Series = field(default_factory=Series)


@dataclass(slots=True)
class Stream:
    """The samples of a key, by arrival time in s."""

    key: str
    kind: str = ""  # the name of its message type; empty for a type unknown to T2
    times: list[float] = field(default_factory=list)
    lost: int = 0  # missing numbers in ``seq``
    undecoded: int = 0  # samples that are not valid messages
    _last_seq: dict[int, int] = field(default_factory=dict)  # by ``boot``

    def add(self, at_s: float, message: Message | None) -> None:
        """Count a sample; the emergency stop has no message."""
        self.times.append(at_s)
        if message is None:
            self.undecoded += chunks(self.key)[1] != keys.ESTOP_PATH
            return
        last = self._last_seq.get(message.boot, message.seq - 1)
        self.lost += max(0, message.seq - last - 1)
        self._last_seq[message.boot] = message.seq

    @property
    def expected_hz(self) -> float:
        """Return the nominal rate; 0 for a key that may pause, or is recorded in part only."""
        topic = topic_of(self.key)
        return topic.rate_hz if topic and topic not in (keys.DRIVE, keys.FIX, keys.PICTURE) else 0.0

    @property
    def hz(self) -> float | None:
        """Return the mean rate."""
        span_s = self.times[-1] - self.times[0]
        return (len(self.times) - 1) / span_s if span_s > 0 else None

    @property
    def gaps(self) -> list[float]:
        """Return the duration of each gap, in s."""
        limit_s = MISSED / self.expected_hz if self.expected_hz else math.inf
        return [b - a for a, b in pairwise(self.times) if b - a > limit_s]


@dataclass(frozen=True, slots=True)
class TimedEvent:
    """An event with its time and its service."""

    at_s: float
    service: str
    event: Event


@dataclass
class Timeline:
    """Everything that a report shows, updated message by message."""

    began_ns: int | None = None
    lasted_s: float = 0.0
    linear: VelocitySeries = field(default_factory=VelocitySeries)
    angular: VelocitySeries = field(default_factory=VelocitySeries)
    path: list[PathSegment] = field(default_factory=list)  # by odometry
    map: MapTrack = field(default_factory=MapTrack)
    verdicts: list[Phase] = field(default_factory=list)
    events: list[TimedEvent] = field(default_factory=list)
    streams: dict[str, Stream] = field(default_factory=dict)  # by key
    versions: dict[str, str] = field(default_factory=dict)  # by service
    pictures: LatchPictures = field(default_factory=LatchPictures)

    def add(self, key: str, kind: str, message: Message | None, log_ns: int) -> None:
        """Add a message of a key and its type; None for one that could not be decoded."""
        self.began_ns = log_ns if self.began_ns is None else self.began_ns
        at_s = (log_ns - self.began_ns) / NS_PER_S
        self.lasted_s = max(self.lasted_s, at_s)
        self.streams.setdefault(key, Stream(key, kind)).add(at_s, message)
        if message is not None:
            self._add(message, key, at_s)
            self.map.add(message, key, at_s)
            self.pictures.add(message, key, at_s)

    def utc(self, at_s: float) -> str:
        """Return the time of day of a moment, by the recorder's clock."""
        at = datetime.fromtimestamp((self.began_ns or 0) / NS_PER_S + at_s, UTC)
        return f"{at:%H:%M:%S}"

    @property
    def messages(self) -> int:
        """Return the number of messages."""
        return sum(len(stream.times) for stream in self.streams.values())

    @property
    def distance(self) -> float:
        """Return the distance driven in metres, by odometry."""
        return sum(segment.length for segment in self.path)

    @property
    def stops(self) -> list[Stop]:
        """Return the stops commanded by safety."""
        return stops(self.verdicts)

    def _add(self, message: Message, key: str, at_s: float) -> None:
        """Add a message by its type; other types are only counted."""
        match message:
            case Drive():
                source = key.rpartition("/")[2]
                self.linear.requested.setdefault(source, Series()).add(at_s, message.linear)
                self.angular.requested.setdefault(source, Series()).add(at_s, message.angular)
            case Motion():
                self.linear.allowed.add(at_s, message.linear)
                self.angular.allowed.add(at_s, message.angular)
            case Velocity():
                self.linear.measured.add(at_s, message.linear)
                self.angular.measured.add(at_s, message.angular)
            case Odometry():
                self._add_pose(message, at_s)
            case SafetyState():
                add_state(self.verdicts, at_s, message, GAP_S)
            case Event():
                self.events.append(TimedEvent(at_s, key.rpartition("/")[2], message))
            case Health():
                self.versions[key.split("/")[-2]] = message.version

    def _add_pose(self, message: Odometry, at_s: float) -> None:
        segment = segment_of(self.path, (message.boot, message.epoch))
        segment.add(at_s, message.x, message.y)


def downsampled(
    times: Sequence[float], values: Sequence[float], limit: int = 4000
) -> tuple[list[float], list[float]]:
    """Return about ``limit`` points at most, with every peak, dip and gap at its place."""
    if len(times) <= limit:
        return list(times), list(values)
    # Up to four points of each block are kept.
    length = math.ceil(4 * len(times) / limit)
    kept = [
        index
        for begin in range(0, len(times), length)
        for index in _extremes(values, range(begin, min(begin + length, len(times))))
    ]
    return [times[index] for index in kept], [values[index] for index in kept]


def _extremes(values: Sequence[float], block: range) -> Iterator[int]:
    known = [index for index in block if not math.isnan(values[index])]
    chosen = [index for index in block if math.isnan(values[index])][:1]
    if known:
        chosen += [
            min(known, key=values.__getitem__), max(known, key=values.__getitem__), known[-1]
        ]  # fmt: skip
    yield from sorted(set(chosen))
