"""Reader for recordings, complete or truncated.

    with Reader(path) as reader:
        for entry in reader:
            entry.key, entry.kind, entry.message, entry.log_ns

If the writer was killed, the file ends inside a chunk: the reader yields everything before it and
sets ``cut``. It skips a damaged chunk and counts it.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from mcap import records
from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader, breakup_chunk
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
        for record in self._records():
            if isinstance(record, records.Channel):
                encoding = record.metadata.get("encoding", "")
                self._channels[record.id] = Channel(record.topic, None, encoding)
            elif isinstance(record, records.Message):
                channel = self._channels.get(record.channel_id)
                if channel and channel.topic.startswith(f"{ROOT}/"):  # not a view
                    yield Entry(channel, record.data, record.log_time)

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
