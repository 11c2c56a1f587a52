"""Reaction times of the bridge, as histograms for the health message.

A reaction is measured from its first time to its last; the times between split it into hops, so
that the hops of one reaction add up to the whole:

================ ================================================================================
reaction         times
================ ================================================================================
board_to_bridge  the kernel received a datagram of the board, the bridge read it
contact_to_break the same of the one with the hit, BRAKE was handed to the socket: the reflex
judged_stop      the same of that one, safety received the bumper message, sent its verdict,
                 the bridge received it, BRAKE was handed to the socket
request_to_frame the request was sent, safety received it, sent its motion, the bridge received
                 it, the frame was handed to the socket
================ ================================================================================

All times are of one host's monotonic clock. An unknown time (another host's clock, no timestamp by
the kernel) leaves out the hops that it bounds; a contact without the kernel's timestamp begins when
it was read. Implausible durations are left out and counted.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate, pairwise

from msgspec import Struct, field

from common.freshness import NS_PER_S
from common.messages import Durations, Motion, Timing
from services.bridge.rx_timestamp import Receipt

# 10 us to 1 s, each bound a third above the last: the range of plausible reactions.
BOUNDS_NS = tuple(round(10_000 * 10 ** (step / 8)) for step in range(41))
LONGEST_NS = 10 * NS_PER_S  # a longer duration means a clock that jumped

Times = Sequence[int | None]  # ns on the monotonic clock; None for unknown


class Reaction(Struct, frozen=True):
    """A reaction and its hops."""

    name: str
    hops: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the health message: the whole, then each hop."""
        return self.name, *(f"{self.name}.{hop}" for hop in self.hops)


READ = Reaction("board_to_bridge")
CONTACT = Reaction("contact_to_break", ("board_to_bridge", "bridge_to_break"))
ACKED = Reaction(
    "judged_stop",
    ("board_to_bridge", "bridge_to_safety", "in_safety", "safety_to_bridge", "bridge_to_break"),
)
REQUEST = Reaction(
    "request_to_frame", ("driver_to_safety", "in_safety", "safety_to_bridge", "bridge_to_frame")
)
REACTIONS = (READ, CONTACT, ACKED, REQUEST)


class Histogram(Struct):
    """Histogram of durations."""

    counts: list[int] = field(default_factory=lambda: [0] * (len(BOUNDS_NS) + 1))
    worst_ns: int = 0

    def add(self, duration_ns: int) -> None:
        """Add a duration."""
        self.counts[bisect_left(BOUNDS_NS, duration_ns)] += 1
        self.worst_ns = max(self.worst_ns, duration_ns)

    def message(self) -> Durations:
        """Return the published form."""
        return Durations(counts=tuple(self.counts), worst=self.worst_ns / NS_PER_S)


class Timings:
    """The histograms of all reactions."""

    def __init__(self) -> None:
        self._histograms = {name: Histogram() for reaction in REACTIONS for name in reaction.names}
        self._of = {
            reaction.name: [self._histograms[name] for name in reaction.names]
            for reaction in REACTIONS
        }
        self._not_counted: Counter[str] = Counter()
        # ``seq`` of its message, and its receive times.
        self._hit: tuple[int, Receipt] | None = None

    def on_read(self, receipt: Receipt) -> None:
        """Record the read of a datagram."""
        if receipt.kernel_ns is None:
            self._not_counted["no_kernel_stamp"] += 1
        self._add(READ, receipt.kernel_ns, (receipt.kernel_ns, receipt.read_ns))

    def on_reflex(self, seq: int, hit: Receipt, sent_ns: int) -> None:
        """Record the BRAKE sent at ``sent_ns`` for the hit in the sample ``seq``."""
        self._hit = seq, hit
        self._add(CONTACT, hit.earliest_ns, (hit.kernel_ns, hit.read_ns, sent_ns))

    def on_motion(self, motion: Motion, shared: bool, received_ns: int, sent_ns: int) -> None:
        """Record the frame of a motion message; ``shared``: its times are of our clock."""
        if not motion.heard_ns:
            return
        if not shared or not motion.asked_ns:
            self._not_counted["foreign_clock"] += 1
        asked_ns = motion.asked_ns or None
        times = (asked_ns, motion.heard_ns, motion.mono_ns) if shared else (None, None, None)
        self._add(REQUEST, times[0], (*times, received_ns, sent_ns))

    def on_acked(self, motion: Motion, shared: bool, received_ns: int, sent_ns: int) -> None:
        """Record the BRAKE of the motion that acknowledged the hit."""
        if self._hit is None:
            return
        (seq, hit), self._hit = self._hit, None
        if not shared:
            self._not_counted["foreign_clock"] += 1
        # If the motion for the first sample was lost, safety's times are of a later sample.
        known = shared and motion.judged == seq
        times = (motion.judged_ns, motion.mono_ns) if known else (None, None)
        self._add(
            ACKED, hit.earliest_ns, (hit.kernel_ns, hit.read_ns, *times, received_ns, sent_ns)
        )

    def message(self) -> Timing:
        """Return the part of the health message."""
        return Timing(
            bounds=tuple(bound / NS_PER_S for bound in BOUNDS_NS),
            durations={name: one.message() for name, one in self._histograms.items()},
            not_counted=dict(self._not_counted),
        )

    def _add(self, reaction: Reaction, begin_ns: int | None, times: Times) -> None:
        spans = [(begin_ns, times[-1]), *(pairwise(times) if reaction.hops else ())]
        for histogram, (from_ns, to_ns) in zip(self._of[reaction.name], spans, strict=True):
            if from_ns is None or to_ns is None:
                continue
            if 0 <= to_ns - from_ns <= LONGEST_NS:
                histogram.add(to_ns - from_ns)
            else:
                self._not_counted["implausible"] += 1


def quantile(bounds: Sequence[float], durations: Durations, part: float) -> float | None:
    """Return a quantile of the durations in seconds; None without any.

    It is the bound of a bucket, or the worst if that is less: an upper bound.
    """
    total = sum(durations.counts)
    if not total:
        return None
    sums = accumulate(durations.counts)
    for bound, below in zip(bounds, sums, strict=False):  # there is one more count than bounds
        if below >= part * total:
            return min(bound, durations.worst)
    return durations.worst
