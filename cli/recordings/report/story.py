"""What a recording tells, in series over time that can be drawn. Pure.

Times are seconds from the recording's first message, on the recorder's wall clock. A series holds
NaN where nothing was known, so that no line is drawn through a gap.
"""

import math
from dataclasses import dataclass, field
from functools import singledispatchmethod
from itertools import pairwise

from cli.recordings.report.phases import Phases
from cli.recordings.report.stops import Stop, stops
from cli.recordings.report.streams import Stream
from common.freshness import NS_PER_S
from common.messages import (
    SONAR_NAMES,
    Bumper,
    Drive,
    Event,
    Health,
    Message,
    Motion,
    Odometry,
    SafetyState,
    Ultrasonic,
    Velocity,
)

NAN = math.nan
GAP_S = 0.5  # the slowest of what is drawn comes at 20 Hz


@dataclass(slots=True)
class Series:
    """A value over time."""

    times: list[float] = field(default_factory=list)  # s
    values: list[float] = field(default_factory=list)

    def add(self, at_s: float, value: float | None) -> None:
        """Take a value; a pause before it stays empty."""
        if self.times and at_s - self.times[-1] > GAP_S:
            self.times.append(self.times[-1])
            self.values.append(NAN)
        self.times.append(at_s)
        self.values.append(NAN if value is None else value)


@dataclass(slots=True)
class Motions:
    """One component of the motion: who asked for what, what came of it; m/s or rad/s."""

    asked: dict[str, Series] = field(default_factory=dict)  # by source
    allowed: Series = field(default_factory=Series)  # what safety let through
    measured: Series = field(default_factory=Series)
    upper: Series = field(default_factory=Series)  # safety's limits at that time
    lower: Series = field(default_factory=Series)


@dataclass(slots=True)
class Stretch:
    """The path of one odometry epoch, in ``odom``; m."""

    epoch: tuple[int, int]
    times: list[float] = field(default_factory=list)
    xs: list[float] = field(default_factory=list)
    ys: list[float] = field(default_factory=list)

    @property
    def length(self) -> float:
        """Return the metres of it."""
        points = list(zip(self.xs, self.ys, strict=True))
        return sum(math.dist(before, after) for before, after in pairwise(points))


@dataclass(frozen=True, slots=True)
class Told:
    """An event, and who told it."""

    at_s: float
    service: str
    event: Event


@dataclass
class Story:
    """Everything that a report shows; fed message by message."""

    began_ns: int | None = None
    lasted_s: float = 0.0
    linear: Motions = field(default_factory=Motions)
    angular: Motions = field(default_factory=Motions)
    path: list[Stretch] = field(default_factory=list)
    ranges: dict[str, Series] = field(
        default_factory=lambda: {name: Series() for name in SONAR_NAMES}
    )
    pressed: Phases[bool] = field(default_factory=lambda: Phases(GAP_S))
    verdicts: Phases[SafetyState] = field(default_factory=lambda: Phases(GAP_S))
    events: list[Told] = field(default_factory=list)
    streams: dict[str, Stream] = field(default_factory=dict)  # by key
    healths: dict[tuple[str, int], tuple[Health, Health]] = field(default_factory=dict)

    def hear(self, key: str, message: Message | None, log_ns: int) -> None:
        """Take what came on a key, None for what could not be read."""
        self.began_ns = log_ns if self.began_ns is None else self.began_ns
        at_s = (log_ns - self.began_ns) / NS_PER_S
        self.lasted_s = max(self.lasted_s, at_s)
        self.streams.setdefault(key, Stream(key)).take(at_s, message)
        if message is not None:
            self._tell(message, key, at_s)

    @property
    def distance(self) -> float:
        """Return how far odometry says that it drove, in metres, either way."""
        return sum(stretch.length for stretch in self.path)

    @property
    def versions(self) -> dict[str, str]:
        """Return the version of each service that told its health, the newest."""
        return {service: last.version for (service, _), (_, last) in self.healths.items()}

    @property
    def stops(self) -> list[Stop]:
        """Return each time in which safety stopped the vehicle."""
        return stops(self.verdicts.done)

    @singledispatchmethod
    def _tell(self, message: Message, key: str, at_s: float) -> None:
        """Take one message by its type; what is not drawn is only counted."""

    @_tell.register
    def _(self, message: Drive, key: str, at_s: float) -> None:
        source = key.rpartition("/")[2]
        self.linear.asked.setdefault(source, Series()).add(at_s, message.linear)
        self.angular.asked.setdefault(source, Series()).add(at_s, message.angular)

    @_tell.register
    def _(self, message: Motion, key: str, at_s: float) -> None:
        self.linear.allowed.add(at_s, message.linear)
        self.angular.allowed.add(at_s, message.angular)

    @_tell.register
    def _(self, message: Velocity, key: str, at_s: float) -> None:
        self.linear.measured.add(at_s, message.linear)
        self.angular.measured.add(at_s, message.angular)

    @_tell.register
    def _(self, message: Odometry, key: str, at_s: float) -> None:
        epoch = (message.boot, message.epoch)
        if not self.path or self.path[-1].epoch != epoch:
            self.path.append(Stretch(epoch))
        stretch = self.path[-1]
        stretch.times.append(at_s)
        stretch.xs.append(message.x)
        stretch.ys.append(message.y)

    @_tell.register
    def _(self, message: Ultrasonic, key: str, at_s: float) -> None:
        for name, distance in zip(SONAR_NAMES, message.ranges, strict=True):
            self.ranges[name].add(at_s, distance)

    @_tell.register
    def _(self, message: Bumper, key: str, at_s: float) -> None:
        self.pressed.take(at_s, message.pressed, message.pressed)

    @_tell.register
    def _(self, message: SafetyState, key: str, at_s: float) -> None:
        self.linear.upper.add(at_s, message.limits.forward)
        self.linear.lower.add(at_s, -message.limits.backward)
        self.angular.upper.add(at_s, message.limits.angular)
        self.angular.lower.add(at_s, -message.limits.angular)
        same = message.verdict, message.latched, tuple(cause.name for cause in message.causes)
        self.verdicts.take(at_s, same, message)

    @_tell.register
    def _(self, message: Event, key: str, at_s: float) -> None:
        self.events.append(Told(at_s, key.rpartition("/")[2], message))

    @_tell.register
    def _(self, message: Health, key: str, at_s: float) -> None:
        life = key.split("/")[-2], message.boot
        first, _ = self.healths.get(life, (message, message))
        self.healths[life] = first, message
