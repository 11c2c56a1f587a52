"""The recorded messages of one vehicle from which its settings are measured. Pure.

All times are those of the monotonic clock of the robot's computer (``mono_ns``), so neither a late
recorder nor a jump of the wall clock changes anything. After a restart of the computer that clock
begins again: the messages of each ``host`` are streams of their own.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median
from typing import TypeVar

from common.freshness import NS_PER_S
from t2.messages import Bumper, Link, Message, Mileage, Motion, Odometry, Ultrasonic, Velocity

M = TypeVar("M", bound=Message)

COARSEST_S = 0.03  # between two velocities; 50 Hz have 0.02 s
FIELDS: dict[type[Message], str] = {
    Motion: "motions", Velocity: "velocities", Mileage: "mileages", Bumper: "bumpers",
    Ultrasonic: "ultrasonics", Link: "links",
    Odometry: "odometries",
}  # fmt: skip
KINDS = {kind.__name__ for kind in FIELDS}


@dataclass(slots=True)
class Streams:
    """The messages by type, in the order of their sending; others are ignored."""

    motions: list[Motion] = field(default_factory=list)
    velocities: list[Velocity] = field(default_factory=list)
    mileages: list[Mileage] = field(default_factory=list)
    bumpers: list[Bumper] = field(default_factory=list)
    ultrasonics: list[Ultrasonic] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    odometries: list[Odometry] = field(default_factory=list)

    def add(self, message: Message) -> None:
        """Add a message."""
        if (name := FIELDS.get(type(message))) is not None:
            getattr(self, name).append(message)

    def sort(self) -> None:
        """Sort by time, and drop repeated messages: two recordings may hold the same ones."""
        for name in FIELDS.values():
            unique = {(one.boot, one.seq, one.mono_ns): one for one in getattr(self, name)}
            setattr(self, name, sorted(unique.values(), key=lambda one: one.mono_ns))

    @property
    def period_s(self) -> float:
        """Median time between two velocities: the resolution of a reaction time."""
        return median_gap_s(self.velocities)

    @property
    def problem(self) -> str:
        """Reason why nothing can be measured, or an empty string."""
        needed: dict[str, Sequence[Message]] = {
            "@cmd/motion": self.motions,
            "tel/bridge/velocity": self.velocities,
            "tel/bridge/mileage": self.mileages,
        }
        missing = [name for name, messages in needed.items() if not messages]
        if missing:
            return f"has no {' and no '.join(missing)}: record all keys with `t2 record`"
        if self.period_s > COARSEST_S:
            return (
                f"has a velocity each {self.period_s:.2f} s, too coarse for a stop: laptops get "
                "downsampled streams over TLS (bus.laptop_rate), so record on the robot"
            )
        return ""


def median_gap_s(messages: Sequence[Message]) -> float:
    """Return the median time between two messages, s; 0 for fewer than two."""
    steps = [b.mono_ns - a.mono_ns for a, b in pairwise(messages)]
    return median(steps) / NS_PER_S if steps else 0.0


def between(messages: Sequence[M], begin_ns: int, end_ns: int) -> Sequence[M]:
    """Return the sorted messages from one time to another."""
    first = bisect_left(messages, begin_ns, key=lambda one: one.mono_ns)
    return messages[first : bisect_right(messages, end_ns, key=lambda one: one.mono_ns)]
