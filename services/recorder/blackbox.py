"""The black box: the last minutes in memory, written when something latches, and some seconds more.

A file is written in slices: what is kept makes some seconds of work, and the bus does not wait.
"""

from collections import deque
from dataclasses import dataclass

from common.freshness import NS_PER_S
from common.sample import Sample
from services.recorder.config import MB, Recorder
from services.recorder.ring_buffer import Memory
from services.recorder.rolling_writer import Begin, End
from services.recorder.writer import Recording

SLICE = 400  # samples at once: some 30 ms of work


@dataclass(slots=True)
class Dump:
    """A file in the making."""

    why: str
    waiting: deque[Sample]
    until_ns: int  # what comes up to then is in it, too
    latest_ns: int  # the end, whatever else may latch
    recording: Recording | None = None


class BlackBox:
    """Keeps, and writes one file at a time; the caller catches ``OSError``."""

    def __init__(self, settings: Recorder, begin: Begin, end: End) -> None:
        self._span_ns = round(settings.black_box * NS_PER_S)
        self._tail_ns = round(settings.tail * NS_PER_S)
        self._memory = Memory(self._span_ns, round(settings.black_box_size * MB))
        self._begin = begin
        self._end = end
        self._dump: Dump | None = None

    def keep(self, sample: Sample) -> None:
        """Keep a sample, and add it to the file in the making."""
        self._memory.add(sample)
        if self._dump is not None and sample.received_ns <= self._dump.until_ns:
            self._dump.waiting.append(sample)

    def latched(self, names: list[str], now_ns: int) -> None:
        """Begin a file, or let the one in the making go on for longer."""
        until_ns = now_ns + self._tail_ns
        if self._dump is None:
            kept = deque(self._memory.samples())
            self._dump = Dump("-".join(names), kept, until_ns, now_ns + self._span_ns)
        else:
            self._dump.until_ns = min(until_ns, self._dump.latest_ns)

    def write(self, now_ns: int) -> None:
        """Write a slice of what waits, and end the file when it is complete."""
        if self._dump is None:
            return
        self._write(self._dump, SLICE)
        if not self._dump.waiting and now_ns > self._dump.until_ns:
            self._finish(self._dump)

    def flush(self) -> None:
        """Let all that is written survive."""
        if self._dump is not None and self._dump.recording is not None:
            self._dump.recording.flush()

    def close(self) -> None:
        """Write all that waits, at the end of the process."""
        if self._dump is not None:
            self._write(self._dump, len(self._dump.waiting))
            self._finish(self._dump)

    def drop(self) -> None:
        """Give up the file in the making: the disk took no more of it."""
        if self._dump is not None:
            self._dump.waiting.clear()
            self._finish(self._dump)

    def _write(self, dump: Dump, most: int) -> None:
        for _ in range(min(most, len(dump.waiting))):
            sample = dump.waiting.popleft()
            if dump.recording is None:
                dump.recording = self._begin(sample, f"latch-{dump.why}")
            dump.recording.write(sample)

    def _finish(self, dump: Dump) -> None:
        self._dump = None
        if dump.recording is not None:
            self._end(dump.recording)
