"""Kernel receive timestamps of datagrams, on the monotonic clock.

Linux stamps datagrams by the wall clock (SO_TIMESTAMPNS), which may be set at any time. The offset
to the monotonic clock is measured at each read: the wall clock is read between two readings of the
monotonic clock, which brackets the offset. Both are slewed alike, so all brackets overlap until the
wall clock is set. Then the offset is measured anew, and older timestamps are rejected:

========================= ================================================
a converted timestamp     is
========================= ================================================
later than the read       rejected
before the clock was set  rejected: it may be by the clock before the step
anything else             the time of reception
========================= ================================================
"""

import struct
from collections.abc import Sequence

from msgspec import Struct

from common.freshness import NS_PER_S

# Linux's SO_TIMESTAMPNS_NEW, which Python does not define: 64 bits for seconds and nanoseconds on
# every machine. The ancillary data has the same number.
SO_TIMESTAMPNS = 64
TIMESPEC = struct.Struct("=qq")
ANCILLARY_MAX = 64  # bytes; the kernel needs 32 for it
TOLERANCE_NS = 1_000  # clocks are read to the nanosecond; a smaller step does not matter


class Receipt(Struct, frozen=True):
    """Receive times of a datagram, in nanoseconds of the monotonic clock."""

    kernel_ns: int | None  # None without a timestamp, or with a rejected one
    read_ns: int

    @property
    def earliest_ns(self) -> int:
        """The kernel's timestamp if there is one, otherwise the read time."""
        return self.read_ns if self.kernel_ns is None else self.kernel_ns


class WallClock:
    """Offset of the wall clock to the monotonic clock."""

    def __init__(self) -> None:
        self.steps = 0  # number of times it was set
        self._bracket: tuple[int, int] | None = None
        self._set_ns = 0  # monotonic time at which the last step was detected

    def update(self, before_ns: int, wall_ns: int, after_ns: int) -> None:
        """Update by a wall clock reading between two monotonic ones."""
        low, high = wall_ns - after_ns, wall_ns - before_ns
        if self._bracket is None:
            self._bracket = low, high
            return
        inner = max(low, self._bracket[0]), min(high, self._bracket[1])
        if inner[0] > inner[1] + TOLERANCE_NS:
            self._bracket, self._set_ns = (low, high), after_ns
            self.steps += 1
        elif inner[0] <= inner[1]:
            self._bracket = inner

    def monotonic_ns(self, stamp_ns: int, now_ns: int) -> int | None:
        """Convert a wall clock timestamp to monotonic time; None when it is rejected."""
        if self._bracket is None:
            return None
        at_ns = stamp_ns - sum(self._bracket) // 2
        return at_ns if self._set_ns <= at_ns <= now_ns else None


def kernel_timestamp(ancillary: Sequence[tuple[int, int, bytes]]) -> int | None:
    """Return the kernel's timestamp in wall clock nanoseconds, or None."""
    for _, kind, content in ancillary:
        if kind == SO_TIMESTAMPNS and len(content) == TIMESPEC.size:
            seconds, nanoseconds = TIMESPEC.unpack(content)
            return int(seconds * NS_PER_S + nanoseconds)
    return None
