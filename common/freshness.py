"""Newest value of a stream with its receive time, on the receiver's monotonic clock."""

from typing import Generic, TypeVar

from msgspec import Struct

T = TypeVar("T")

NS_PER_S = 1_000_000_000  # nanoseconds in a second


class Latest(Struct, Generic[T], frozen=True):
    """A value with its local receive time; make a new one for each sample."""

    value: T
    received_ns: int

    def age_s(self, now_ns: int) -> float:
        """Return the age in seconds."""
        return (now_ns - self.received_ns) / NS_PER_S


def fresh(latest: Latest[T] | None, now_ns: int, limit_s: float) -> bool:
    """Return whether there is a value at most ``limit_s`` old."""
    return latest is not None and latest.age_s(now_ns) <= limit_s
