"""Reader for recordings, complete or truncated.

    with Reader(path) as reader:
        for entry in reader:
            entry.key, entry.kind, entry.message, entry.log_ns

If the writer was killed, the file ends inside a chunk: the reader yields everything before it and
sets ``cut``. It skips a damaged chunk and counts it.

``periods`` and ``selected`` read only the chunks of some keys, in a file that is complete.
"""

import struct
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Self

from mcap import records
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.summary import Summary
from zstandard import ZstdError

from services.recorder.mcap_codec import Channel, Entry
from t2.errors import T2Error
from t2.keys import ROOT

# Raised by the MCAP library for missing or wrong bytes.
DAMAGE = (McapError, struct.error, ValueError, RuntimeError, EOFError, OverflowError, MemoryError)
RECORD_MAX = 1 << 28  # bytes; a larger record is damage


class Reader:
    """Yields the messages of the bus in the order of their arrival, once."""

    def __init__(self, path: Path) -> None:
        """Open a file; raise ``T2Error`` if it cannot be read."""
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise T2Error(f"{path}: cannot be read: {error.strerror}") from None
        self.path = path
        self.size = path.stat().st_size
        self.cut = False  # truncated: the writer was killed, or is still writing
        self.damaged = 0  # chunks that were skipped
        self._channels: dict[int, Channel] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __iter__(self) -> Iterator[Entry]:
        """Yield all messages; raise ``T2Error`` if the file is not an MCAP file."""
        yield from self._entries(self._records())

    def _entries(self, found: Iterable[records.McapRecord]) -> Iterator[Entry]:
        for record in found:
            if isinstance(record, records.Channel):
                encoding = record.metadata.get("encoding", "")
                self._channels[record.id] = Channel(record.topic, None, encoding)
            elif isinstance(record, records.Message):
                channel = self._channels.get(record.channel_id)
                if channel and channel.topic.startswith(f"{ROOT}/"):  # not a view
                    yield Entry(channel, record.data, record.log_time)

    @cached_property
    def _summary(self) -> Summary | None:
        """The index at the end of the file; None if the file is cut."""
        try:
            found = SeekingReader(self._file, record_size_limit=RECORD_MAX).get_summary()
        except DAMAGE:
            found = None
        self._file.seek(0)
        return found

    @property
    def is_indexed(self) -> bool:
        """Whether the file is complete, so that ``periods`` and ``selected`` have an index."""
        return self._summary is not None

    def periods(self, is_wanted: Callable[[str], bool]) -> Iterator[tuple[str, int, int]]:
        """Yield key, begin and end (ns) of each chunk with a key; nothing without an index."""
        for key, index in self._chunks(is_wanted):
            yield key, index.message_start_time, index.message_end_time

    def selected(self, is_wanted: Callable[[str], bool]) -> Iterator[Entry]:
        """Yield the messages of some keys; nothing without an index."""
        offsets = dict.fromkeys(index.chunk_start_offset for _, index in self._chunks(is_wanted))
        for offset in offsets:
            self._file.seek(offset)
            reader = StreamReader(
                self._file, skip_magic=True, emit_chunks=True, record_size_limit=RECORD_MAX
            )
            try:
                found = self._unpacked(next(reader.records))
            except (*DAMAGE, StopIteration):
                self.damaged += 1
                continue
            for entry in self._entries(found):
                if is_wanted(entry.key):
                    yield entry

    def _chunks(self, is_wanted: Callable[[str], bool]) -> Iterator[tuple[str, records.ChunkIndex]]:
        if self._summary is not None:
            list(self._entries(self._summary.channels.values()))  # a chunk has only its new ones
            wanted = {
                channel.id: channel.topic
                for channel in self._summary.channels.values()
                if is_wanted(channel.topic)
            }
            for index in self._summary.chunk_indexes:
                for number in wanted.keys() & index.message_index_offsets.keys():
                    yield wanted[number], index

    def _records(self) -> Iterator[records.McapRecord]:
        """Yield the records of the file and of its chunks, up to the truncation."""
        reader = StreamReader(self._file, emit_chunks=True, record_size_limit=RECORD_MAX)
        has_begun = False
        try:
            for record in reader.records:
                has_begun = True
                yield from self._unpacked(record)
        except DAMAGE:
            if not has_begun:
                raise T2Error(f"{self.path}: is not an MCAP file") from None
            self.cut = True

    def _unpacked(self, record: records.McapRecord) -> list[records.McapRecord]:
        if not isinstance(record, records.Chunk):
            return [record]
        try:
            return breakup_chunk(record, validate_crc=True)
        except (*DAMAGE, ZstdError):
            self.damaged += 1
            return []
