"""The black box: buffers the last minutes and writes them when safety latches a cause. Pure.

Theory of operation: a ring buffer holds the newest samples. A latch starts a dump of them and of
the samples of the next seconds. A dump takes some seconds, so it is written in
slices and the event loop continues in between. What waits for it stays in the buffer.
"""

import re
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from math import inf
from typing import TYPE_CHECKING

from common.freshness import NS_PER_S
from t2 import keys
from t2.codec import Sample
from t2.messages import SafetyState

if TYPE_CHECKING:
    from services.recorder.writer import RecordingWriter

SPAN_NS, TAIL_NS = 120 * NS_PER_S, 10 * NS_PER_S  # kept before a latch, and recorded after it
SIZE_MAX = 64_000_000  # bytes of memory
PICTURE = re.compile(keys.PICTURE.on("[^/]+", camera="[^/]+"))  # keys of pictures
CAMERAS_MAX = 16  # keys: any member can invent some
PICTURE_NS, PICTURES_NS = NS_PER_S // 2, 30 * NS_PER_S  # between two pictures; before a latch
SLICE = 400  # samples written at once: about 30 ms of work
# Python's memory for a sample besides its bytes, with key and encoding: 450 B by tracemalloc.
OVERHEAD = 470

# Opens a recording for its first sample and a reason; raises OSError.
OpenRecording = Callable[[Sample, str], "RecordingWriter"]
CloseRecording = Callable[["RecordingWriter"], None]


class PictureThinning:
    """Two pictures a second of each camera; everything else."""

    def __init__(self) -> None:
        self._last_ns: dict[str, int] = {}  # by key

    def keeps(self, sample: Sample) -> bool:
        """Return whether a sample is recorded."""
        if not PICTURE.fullmatch(sample.key):
            return True
        last_ns = self._last_ns.get(sample.key)
        if last_ns is not None and sample.received_ns - last_ns < PICTURE_NS:
            return False
        if last_ns is not None or len(self._last_ns) < CAMERAS_MAX:
            self._last_ns[sample.key] = sample.received_ns
            return True
        return False


class RingBuffer:
    """The newest samples, bounded in time and in bytes: the largest key loses its oldest first."""

    def __init__(self, span_ns: int, size_max: int) -> None:
        self.size = 0  # bytes, estimated
        self._span_ns, self._size_max = span_ns, size_max
        self._samples: dict[int, Sample] = {}  # by number, in the order of reception
        self._first = self._next = 0  # numbers of the oldest sample and of the next one
        self._numbers: defaultdict[str, deque[int]] = defaultdict(deque)  # by key
        self._sizes: Counter[str] = Counter()  # bytes by key

    def add(self, sample: Sample, unwritten: float = inf) -> None:
        """Add a sample; drop what exceeds the size, or the time span before ``unwritten``."""
        self._samples[self._next] = sample
        self._numbers[sample.key].append(self._next)
        self._next += 1
        self._sizes[sample.key] += sample.size + OVERHEAD
        self.size += sample.size + OVERHEAD
        since_ns = sample.received_ns - self._span_ns
        while self._first < unwritten and self._samples[self._first].received_ns < since_ns:
            self._drop(self._samples[self._first].key)
        while self.size > self._size_max:
            self._drop(max(self._sizes, key=self._sizes.__getitem__))

    def since(self, number: int, until_ns: float = inf) -> Iterator[tuple[int, Sample]]:
        """Yield the samples from this number to this time, with their numbers."""
        for each in range(max(number, self._first), self._next):
            if each in self._samples and self._samples[each].received_ns <= until_ns:
                yield each, self._samples[each]

    def _drop(self, key: str) -> None:
        """Drop the oldest sample of a key."""
        sample = self._samples.pop(self._numbers[key].popleft())
        while self._first < self._next and self._first not in self._samples:
            self._first += 1
        self._sizes[key] -= sample.size + OVERHEAD
        self.size -= sample.size + OVERHEAD
        if not self._numbers[key]:
            del self._numbers[key], self._sizes[key]


@dataclass(slots=True)
class Dump:
    """A black-box file in progress."""

    reason: str
    number: int  # of the next sample in the buffer
    until_ns: int  # samples up to this time belong to the file
    limit_ns: int  # the latest value of until_ns, whatever else latches
    pictures_ns: int  # pictures from this time on belong to the file
    recording: "RecordingWriter | None" = None


class BlackBox:
    """Buffers samples and writes one dump at a time; the caller handles ``OSError``."""

    def __init__(
        self,
        open_recording: OpenRecording,
        close_recording: CloseRecording,
        span_ns: int = SPAN_NS,
        tail_ns: int = TAIL_NS,
        size_max: int = SIZE_MAX,
    ) -> None:
        self._span_ns, self._tail_ns = span_ns, tail_ns
        self._buffer = RingBuffer(span_ns, size_max)
        self._open_recording = open_recording
        self._close_recording = close_recording
        self._dump: Dump | None = None
        self._latched: set[str] | None = None  # None until the first state

    def new_causes(self, state: SafetyState) -> list[str]:
        """Return the causes that have latched since the previous state.

        Causes of the first state do not count: they latched before the buffered minutes.
        """
        before, self._latched = self._latched, set(state.latched)
        return [] if before is None else sorted(self._latched - before)

    def add(self, sample: Sample) -> None:
        """Buffer a sample, also for the dump in progress."""
        self._buffer.add(sample, self._dump.number if self._dump else inf)

    def trigger(self, causes: list[str], now_ns: int) -> None:
        """Start a dump, or extend the one in progress."""
        until_ns = now_ns + self._tail_ns
        if self._dump is None:
            limit_ns, pictures_ns = now_ns + self._span_ns, now_ns - PICTURES_NS
            self._dump = Dump("-".join(causes), 0, until_ns, limit_ns, pictures_ns)
        else:
            self._dump.until_ns = min(until_ns, self._dump.limit_ns)

    def write(self, now_ns: int) -> None:
        """Write a slice of the pending samples; close the file when it is complete."""
        if self._dump is not None:
            self._write(self._dump, SLICE)
            left = self._buffer.since(self._dump.number, self._dump.until_ns)
            if now_ns > self._dump.until_ns and not any(left):
                self.finish()

    def flush(self) -> None:
        """Hand all written samples to the operating system."""
        if self._dump is not None and self._dump.recording is not None:
            self._dump.recording.flush()

    def close(self) -> None:
        """Write all pending samples and close the file, when the process ends."""
        if self._dump is not None:
            self._write(self._dump, None)
            self.finish()

    def finish(self) -> None:
        """Close the file without the pending samples, also after a disk error."""
        dump, self._dump = self._dump, None
        if dump is not None and dump.recording is not None:
            self._close_recording(dump.recording)

    def _write(self, dump: Dump, limit: int | None) -> None:
        for number, sample in islice(self._buffer.since(dump.number, dump.until_ns), limit):
            dump.number = number + 1
            if sample.received_ns < dump.pictures_ns and PICTURE.fullmatch(sample.key):
                continue
            if dump.recording is None:
                dump.recording = self._open_recording(sample, f"latch-{dump.reason}")
            dump.recording.write(sample)
