"""Everything, to one file after the other."""

from collections.abc import Callable

from common.freshness import NS_PER_S
from common.sample import Sample
from services.recorder.config import MB, Recorder
from services.recorder.writer import Recording

Begin = Callable[[Sample, str], Recording]  # the first sample, and why in a word; raises OSError
End = Callable[[Recording], None]


class Tape:
    """Writes as long as there is room; the caller says so, and catches ``OSError``."""

    def __init__(self, settings: Recorder, begin: Begin, end: End) -> None:
        self._size_max = settings.roll_size * MB
        self._time_max_ns = round(settings.roll_time * NS_PER_S)
        self._begin = begin
        self._end = end
        self._recording: Recording | None = None
        self._began_ns = 0

    def write(self, sample: Sample) -> None:
        """Add a sample, to a new file when there is none."""
        if self._recording is None:
            self._recording = self._begin(sample, "")
            self._began_ns = sample.received_ns
        self._recording.write(sample)

    def flush(self, now_ns: int) -> None:
        """Let all survive; end a file that is large or old enough."""
        if self._recording is None:
            return
        self._recording.flush()
        too_old = now_ns - self._began_ns > self._time_max_ns
        if too_old or self._recording.size > self._size_max:
            self.close()

    def close(self) -> None:
        """End the file, if there is one."""
        ended, self._recording = self._recording, None
        if ended is not None:
            self._end(ended)
