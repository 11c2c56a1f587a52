"""MCAP files: one recording, and a series of recordings of limited size and duration.

Messages go into compressed chunks. ``flush`` ends a chunk and hands it to the operating system.
Everything up to the last flush stays readable, even after ``kill -9``.
"""

import contextlib
import fcntl
from pathlib import Path

from mcap.writer import Writer

from common.freshness import NS_PER_S
from services.recorder.blackbox import CloseRecording, OpenRecording
from services.recorder.mcap_codec import Channel, Encoder, Entry
from t2.codec import Sample

SIZE_MAX, TIME_MAX_NS = 200_000_000, 600 * NS_PER_S  # of a file of a continuous recording


class RecordingWriter:
    """One file, open for writing; raises ``OSError`` when the disk refuses a write."""

    def __init__(self, path: Path, encoder: Encoder) -> None:
        """Create a new file; raise ``FileExistsError`` instead of overwriting one."""
        self.path = path
        self.messages = 0  # from the bus, without the derived views
        self._encoder = encoder
        self._clock_ns: int | None = None
        self._ids: dict[Channel, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = path.open("xb")
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # other recorders leave the file
        self._writer = Writer(self._file)
        self._writer.start(library="t2")
        self._writer.flush()

    @property
    def size(self) -> int:
        """Return the size of the file in bytes, without the chunk in progress."""
        return self._file.tell()

    def write(self, sample: Sample) -> None:
        """Add a sample and its views.

        Log times start at the wall clock of the first sample and advance with the monotonic clock:
        they do not jump when the time of day is set.
        """
        if self._clock_ns is None:
            self._clock_ns = sample.wall_ns - sample.received_ns
        for entry in self._encoder.entries(sample, sample.received_ns + self._clock_ns):
            self._add(entry)
        self.messages += 1

    def flush(self) -> None:
        """End the chunk: its content survives a crash of this process."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and close the file, even if the disk refuses the index."""
        try:
            self._writer.finish()
        finally:
            self._file.close()

    def _add(self, entry: Entry) -> None:
        identity = self._ids.get(entry.channel) or self._register(entry.channel)
        self._writer.add_message(identity, entry.log_ns, entry.data, entry.log_ns)

    def _register(self, channel: Channel) -> int:
        schema_id = 0
        if channel.schema:
            name = channel.schema.name
            if name not in self._schemas:
                self._schemas[name] = self._writer.register_schema(
                    name, "jsonschema", channel.schema.data
                )
            schema_id = self._schemas[name]
        about = {"encoding": channel.encoding}
        self._ids[channel] = self._writer.register_channel(channel.topic, "json", schema_id, about)
        return self._ids[channel]


class RollingWriter:
    """Continuous recording, one file after another; the caller handles ``OSError``."""

    def __init__(
        self,
        open_recording: OpenRecording,
        close_recording: CloseRecording,
        size_max: int = SIZE_MAX,
        time_max_ns: int = TIME_MAX_NS,
    ) -> None:
        self._size_max, self._time_max_ns = size_max, time_max_ns
        self._open_recording = open_recording
        self._close_recording = close_recording
        self._recording: RecordingWriter | None = None
        self._opened_ns = 0

    def write(self, sample: Sample) -> None:
        """Add a sample; open a new file if none is open."""
        if self._recording is None:
            self._recording = self._open_recording(sample, "")
            self._opened_ns = sample.received_ns
        self._recording.write(sample)

    def flush(self, now_ns: int) -> None:
        """Flush the file; close it when it is large or old enough."""
        if self._recording is None:
            return
        self._recording.flush()
        too_old = now_ns - self._opened_ns > self._time_max_ns
        if too_old or self._recording.size > self._size_max:
            self.close()

    def close(self) -> None:
        """Close the file, if one is open."""
        recording, self._recording = self._recording, None
        if recording is not None:
            self._close_recording(recording)
