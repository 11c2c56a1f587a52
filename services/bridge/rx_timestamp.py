"""When the kernel received a datagram, on the monotonic clock.

Linux stamps datagrams by the wall clock (SO_TIMESTAMPNS), and a wall clock is set now and then. How
far it is ahead of the monotonic clock is measured beside each read: the one is read between two
readings of the other, which brackets the difference. Both are slewed alike, so all brackets overlap
until the wall clock is set. Then what was learnt is forgotten, and what may have been stamped
before is not believed:

========================= ==========================================
a stamp that comes out as is
========================= ==========================================
later than the read       not believed
before the clock was set  not believed: it may be by the clock of then
anything else             the time of reception
========================= ==========================================
"""

import struct
from collections.abc import Sequence

from msgspec import Struct

# Linux's SO_TIMESTAMPNS_NEW, of which Python has no name: 64 bits for seconds and nanoseconds on
# every machine. The same number names the ancillary data.
SO_TIMESTAMPNS = 64
TIMESPEC = struct.Struct("=qq")
ANCILLARY_MAX = 64  # bytes; the kernel needs 32 for it
TOLERANCE_NS = 1_000  # clocks are read to the nanosecond, and nobody sets one by so little
S_NS = 1_000_000_000


class Receipt(Struct, frozen=True):
    """When a datagram came, in nanoseconds of the monotonic clock."""

    kernel_ns: int | None  # None without a stamp, or with one that is not believed
    read_ns: int

    @property
    def earliest_ns(self) -> int:
        """The kernel's time where there is one, else when it was read."""
        return self.read_ns if self.kernel_ns is None else self.kernel_ns


class WallClock:
    """How far the wall clock is ahead of the monotonic one, by what was read of both."""

    def __init__(self) -> None:
        self.steps = 0  # how often it was set
        self._bracket: tuple[int, int] | None = None
        self._set_ns = 0  # when it was seen to have been set, monotonic

    def look(self, before_ns: int, wall_ns: int, after_ns: int) -> None:
        """Take in the wall clock, read between two readings of the monotonic one."""
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
        """Return a wall clock's stamp as monotonic time; None when it is not believed."""
        if self._bracket is None:
            return None
        at_ns = stamp_ns - sum(self._bracket) // 2
        return at_ns if self._set_ns <= at_ns <= now_ns else None


def stamp_in(ancillary: Sequence[tuple[int, int, bytes]]) -> int | None:
    """Return the kernel's stamp, nanoseconds of the wall clock, or None without one."""
    for _, kind, content in ancillary:
        if kind == SO_TIMESTAMPNS and len(content) == TIMESPEC.size:
            seconds, nanoseconds = TIMESPEC.unpack(content)
            return int(seconds * S_NS + nanoseconds)
    return None
