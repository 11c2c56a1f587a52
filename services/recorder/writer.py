"""An MCAP file that is being written.

Messages go into compressed chunks. ``flush`` ends a chunk and hands it to the system: whatever
happens to this process afterwards, all up to there can be read.
"""

import contextlib
import fcntl
from collections.abc import Mapping
from pathlib import Path

from mcap.writer import Writer

from common.sample import Sample
from services.recorder.mcap_codec import Channel, Entry, Translator

ABOUT = "t2"  # the metadata record that says whose recording it is


class Recording:
    """One file, open for writing; raises ``OSError`` when the disk does not take it."""

    def __init__(self, path: Path, translator: Translator, about: Mapping[str, str]) -> None:
        """Begin a new file; one that is there already is not touched."""
        self.path = path
        self.messages = 0  # from the bus; what is drawn of them is not counted
        self._translator = translator
        self._clock_ns: int | None = None
        self._ids: dict[Channel, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = path.open("xb")
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # see ``shelf.in_use``
        self._writer = Writer(self._file)
        self._writer.start(library="t2")
        self._writer.add_metadata(ABOUT, dict(about))
        self._writer.flush()

    @property
    def size(self) -> int:
        """Return the bytes that the file has by now, without the chunk in progress."""
        return self._file.tell()

    def write(self, sample: Sample) -> None:
        """Add a sample and what is drawn of it.

        The file's time is the wall clock at its first sample and goes on by the monotonic one: it
        does not jump with the time of day.
        """
        if self._clock_ns is None:
            self._clock_ns = sample.wall_ns - sample.received_ns
        for entry in self._translator.entries(sample, sample.received_ns + self._clock_ns):
            self._add(entry)
        self.messages += 1

    def flush(self) -> None:
        """Let all that was written survive this process."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index and end the file; it is closed even if the disk takes no more."""
        try:
            self._writer.finish()
        finally:
            self._file.close()

    def _add(self, entry: Entry) -> None:
        identity = self._ids.get(entry.channel) or self._register(entry.channel)
        self._writer.add_message(
            identity, entry.log_ns, entry.data, entry.publish_ns, entry.sequence
        )

    def _register(self, channel: Channel) -> int:
        schema_id = 0
        if channel.schema:
            name = channel.schema.name
            if name not in self._schemas:
                self._schemas[name] = self._writer.register_schema(
                    name, "jsonschema", channel.schema.data
                )
            schema_id = self._schemas[name]
        about = {"drawn": "yes"} if channel.drawn else {"encoding": channel.encoding}
        self._ids[channel] = self._writer.register_channel(channel.topic, "json", schema_id, about)
        return self._ids[channel]
