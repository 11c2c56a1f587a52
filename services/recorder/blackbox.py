"""The black box: buffers the last minutes and writes them when safety latches a cause. Pure.

Theory of operation: a ring buffer holds the newest samples. A latch copies them to a dump, and the
dump also takes the samples of the next seconds (``recorder.tail``). A dump holds work for some
seconds, so it is written in slices and the event loop continues in between.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from common.freshness import NS_PER_S
from common.messages import SafetyState
from common.sample import Sample
from services.recorder.config import MB, Recorder

if TYPE_CHECKING:
    from services.recorder.writer import RecordingWriter

SLICE = 400  # samples written at once: about 30 ms of work
# Python's memory for a sample besides its bytes, with key and encoding: 380 B by tracemalloc.
OVERHEAD = 400

# Opens a recording for its first sample and a reason; raises OSError.
OpenRecording = Callable[[Sample, str], "RecordingWriter"]
CloseRecording = Callable[["RecordingWriter"], None]


class RingBuffer:
    """The newest samples, bounded in time and in bytes; the oldest are dropped first."""

    def __init__(self, span_ns: int, size_max: int) -> None:
        self.size = 0  # bytes, estimated
        self._span_ns = span_ns
        self._size_max = size_max
        self._samples: deque[Sample] = deque()

    def add(self, sample: Sample) -> None:
        """Add a sample; drop what exceeds the time span or the size."""
        self._samples.append(sample)
        self.size += sample.size + OVERHEAD
        oldest_ns = sample.received_ns - self._span_ns
        while self._samples[0].received_ns < oldest_ns or self.size > self._size_max:
            self.size -= self._samples.popleft().size + OVERHEAD
            if not self._samples:
                return

    def samples(self) -> list[Sample]:
        """Return all samples, the oldest first."""
        return list(self._samples)


class LatchDetector:
    """Compares each safety state with the previous one."""

    def __init__(self) -> None:
        self._known: set[str] | None = None  # None until the first state

    def update(self, state: SafetyState) -> list[str]:
        """Return the causes that have latched since the previous state.

        Causes of the first state do not count: they latched before the buffered minutes.
        """
        now = set(state.latched)
        new = [] if self._known is None else sorted(now - self._known)
        self._known = now
        return new


@dataclass(slots=True)
class Dump:
    """A black-box file in progress."""

    reason: str
    pending: deque[Sample]
    until_ns: int  # samples up to this time belong to the file
    limit_ns: int  # the latest value of until_ns, whatever else latches
    recording: "RecordingWriter | None" = None


class BlackBox:
    """Buffers samples and writes one dump at a time; the caller handles ``OSError``."""

    def __init__(
        self, settings: Recorder, open_recording: OpenRecording, close_recording: CloseRecording
    ) -> None:
        self._span_ns = round(settings.black_box * NS_PER_S)
        self._tail_ns = round(settings.tail * NS_PER_S)
        self._buffer = RingBuffer(self._span_ns, round(settings.black_box_size * MB))
        self._open_recording = open_recording
        self._close_recording = close_recording
        self._dump: Dump | None = None

    def add(self, sample: Sample) -> None:
        """Buffer a sample, and add it to the dump in progress."""
        self._buffer.add(sample)
        if self._dump is not None and sample.received_ns <= self._dump.until_ns:
            self._dump.pending.append(sample)

    def trigger(self, causes: list[str], now_ns: int) -> None:
        """Start a dump, or extend the one in progress."""
        until_ns = now_ns + self._tail_ns
        if self._dump is None:
            buffered = deque(self._buffer.samples())
            self._dump = Dump("-".join(causes), buffered, until_ns, now_ns + self._span_ns)
        else:
            self._dump.until_ns = min(until_ns, self._dump.limit_ns)

    def write(self, now_ns: int) -> None:
        """Write a slice of the pending samples; close the file when it is complete."""
        if self._dump is None:
            return
        self._write(self._dump, SLICE)
        if not self._dump.pending and now_ns > self._dump.until_ns:
            self._finish(self._dump)

    def flush(self) -> None:
        """Hand all written samples to the operating system."""
        if self._dump is not None and self._dump.recording is not None:
            self._dump.recording.flush()

    def close(self) -> None:
        """Write all pending samples and close the file, when the process ends."""
        if self._dump is not None:
            self._write(self._dump, len(self._dump.pending))
            self._finish(self._dump)

    def abort(self) -> None:
        """Discard the pending samples and close the file, after a disk error."""
        if self._dump is not None:
            self._dump.pending.clear()
            self._finish(self._dump)

    def _write(self, dump: Dump, limit: int) -> None:
        for _ in range(min(limit, len(dump.pending))):
            sample = dump.pending.popleft()
            if dump.recording is None:
                dump.recording = self._open_recording(sample, f"latch-{dump.reason}")
            dump.recording.write(sample)

    def _finish(self, dump: Dump) -> None:
        self._dump = None
        if dump.recording is not None:
            self._close_recording(dump.recording)
