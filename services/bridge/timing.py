"""How fast the bridge reacts, and where the time goes: histograms for the health message.

A way is a reaction from its first time to its last; the times between split it into hops, so that
the hops of one reaction add up to the whole:

================ ================================================================================
way              times
================ ================================================================================
board_to_bridge  the kernel received a datagram of the board, the bridge read it
contact_to_break the same of the one with the hit, BREAK was handed to the socket: the reflex
judged_stop      the same of that one, safety received the bumper message, sent its verdict,
                 the bridge received it, BREAK was handed to the socket
request_to_frame the request was sent, safety received it, sent its motion, the bridge received
                 it, the frame was handed to the socket
================ ================================================================================

All are of one host's monotonic clock. A time that is not known (another host's clock, no stamp by
the kernel) leaves out what it bounds; a contact without the kernel's stamp begins when it was read.
What cannot be true is not counted, and this is counted.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate, pairwise

from msgspec import Struct, field

from common.freshness import NS_PER_S
from common.messages import Durations, Motion, Timing
from services.bridge.rx_timestamp import Receipt

# 10 us to 1 s, a third more each: nothing here is faster, and what is slower has failed.
BOUNDS_NS = tuple(round(10_000 * 10 ** (step / 8)) for step in range(41))
LONGEST_NS = 10 * NS_PER_S  # a reaction that took longer is a clock that jumped

Times = Sequence[int | None]  # ns on the monotonic clock; None for unknown


class Way(Struct, frozen=True):
    """A reaction, and the hops that it is made of."""

    name: str
    hops: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The whole, and then each hop, as the health message calls them."""
        return self.name, *(f"{self.name}.{hop}" for hop in self.hops)


READ = Way("board_to_bridge")
CONTACT = Way("contact_to_break", ("board_to_bridge", "bridge_to_break"))
JUDGED = Way(
    "judged_stop",
    ("board_to_bridge", "bridge_to_safety", "in_safety", "safety_to_bridge", "bridge_to_break"),
)
REQUEST = Way(
    "request_to_frame", ("driver_to_safety", "in_safety", "safety_to_bridge", "bridge_to_frame")
)
WAYS = (READ, CONTACT, JUDGED, REQUEST)


class Histogram(Struct):
    """Durations by size."""

    counts: list[int] = field(default_factory=lambda: [0] * (len(BOUNDS_NS) + 1))
    worst_ns: int = 0

    def add(self, duration_ns: int) -> None:
        """Count one."""
        self.counts[bisect_left(BOUNDS_NS, duration_ns)] += 1
        self.worst_ns = max(self.worst_ns, duration_ns)

    def message(self) -> Durations:
        """Return what is published."""
        return Durations(counts=tuple(self.counts), worst=self.worst_ns / NS_PER_S)


class Timings:
    """The histograms of all ways."""

    def __init__(self) -> None:
        self._histograms = {name: Histogram() for way in WAYS for name in way.names}
        self._of = {way.name: [self._histograms[name] for name in way.names] for way in WAYS}
        self._not_counted: Counter[str] = Counter()
        self._hit: tuple[int, Receipt] | None = None  # ``seq`` of its message, and when it came

    def on_read(self, receipt: Receipt) -> None:
        """Take in that a datagram of the board was read."""
        if receipt.kernel_ns is None:
            self._not_counted["no_kernel_stamp"] += 1
        self._add(READ, receipt.kernel_ns, (receipt.kernel_ns, receipt.read_ns))

    def on_reflex(self, seq: int, hit: Receipt, sent_ns: int) -> None:
        """Take in that BREAK went out, at ``sent_ns``, for the hit in the sample ``seq``."""
        self._hit = seq, hit
        self._add(CONTACT, hit.earliest_ns, (hit.kernel_ns, hit.read_ns, sent_ns))

    def on_motion(self, motion: Motion, shared: bool, received_ns: int, sent_ns: int) -> None:
        """Take in that a motion message became a frame; ``shared``: stamped by our own clock."""
        if not motion.heard_ns:
            return
        if not shared or not motion.asked_ns:
            self._not_counted["foreign_clock"] += 1
        asked_ns = motion.asked_ns or None
        times = (asked_ns, motion.heard_ns, motion.mono_ns) if shared else (None, None, None)
        self._add(REQUEST, times[0], (*times, received_ns, sent_ns))

    def on_judged(self, motion: Motion, shared: bool, received_ns: int, sent_ns: int) -> None:
        """Take in that the motion which judged the hit became a BREAK."""
        if self._hit is None:
            return
        (seq, hit), self._hit = self._hit, None
        if not shared:
            self._not_counted["foreign_clock"] += 1
        # A later sample has judged it when the first one's motion was lost: safety's times are
        # of that one.
        known = shared and motion.judged == seq
        times = (motion.judged_ns, motion.mono_ns) if known else (None, None)
        self._add(
            JUDGED, hit.earliest_ns, (hit.kernel_ns, hit.read_ns, *times, received_ns, sent_ns)
        )

    def message(self) -> Timing:
        """Return what goes into the health message."""
        return Timing(
            bounds=tuple(bound / NS_PER_S for bound in BOUNDS_NS),
            durations={name: one.message() for name, one in self._histograms.items()},
            not_counted=dict(self._not_counted),
        )

    def _add(self, way: Way, begin_ns: int | None, times: Times) -> None:
        spans = [(begin_ns, times[-1]), *(pairwise(times) if way.hops else ())]
        for histogram, (from_ns, to_ns) in zip(self._of[way.name], spans, strict=True):
            if from_ns is None or to_ns is None:
                continue
            if 0 <= to_ns - from_ns <= LONGEST_NS:
                histogram.add(to_ns - from_ns)
            else:
                self._not_counted["implausible"] += 1


def quantile(bounds: Sequence[float], durations: Durations, part: float) -> float | None:
    """Return what this part of the durations took at most, in seconds; None when there are none.

    It is the bound of a bucket, or the worst where that is less: never too small.
    """
    total = sum(durations.counts)
    if not total:
        return None
    sums = accumulate(durations.counts)
    for bound, below in zip(bounds, sums, strict=False):  # there is one more count than bounds
        if below >= part * total:
            return min(bound, durations.worst)
    return durations.worst
