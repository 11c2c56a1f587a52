"""Reader for recordings, complete or truncated.

    with Reader(path) as reader:
        for entry in reader:
            entry.key, entry.kind, entry.message, entry.log_ns

If the writer was killed, the file ends inside a chunk: the reader yields everything before it and
sets ``cut``. It skips a damaged chunk and counts it.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap import records
from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from common import codec
from common.errors import MessageError, RobotError
from common.messages import Message
from common.sample import Sample
from services.recorder import mcap_codec
from services.recorder.writer import ABOUT

# Raised by the MCAP library for missing or wrong bytes.
DAMAGE = (McapError, struct.error, ValueError, RuntimeError, EOFError, OverflowError, MemoryError)
RECORD_MAX = 1 << 28  # bytes; a larger record is damage


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """A message of the bus in a recording."""

    entry: mcap_codec.Entry

    @property
    def key(self) -> str:
        """Return the full key, ``t2/v1/001/tel/odom/odometry``."""
        return self.entry.channel.topic

    @property
    def kind(self) -> str:
        """Return the name of its type, ``Odometry``; empty for a type unknown to T2."""
        name = codec.kind_of(self.entry.channel.encoding)
        return name if name in mcap_codec.MESSAGE_TYPES else ""

    @property
    def log_ns(self) -> int:
        """Return the time of reception on the recorder's wall clock."""
        return self.entry.log_ns

    @property
    def message(self) -> Message | None:
        """Return the decoded message; None if its type is unknown or it is invalid."""
        kind = mcap_codec.MESSAGE_TYPES.get(self.kind)
        if kind is None:
            return None
        try:
            return codec.decode(self.sample.payload, kind)
        except MessageError:
            return None

    @property
    def sample(self) -> Sample:
        """Return the original bytes of the bus."""
        return mcap_codec.decode_sample(self.entry)


class Reader:
    """Yields the messages of the bus in the order of their arrival, once."""

    def __init__(self, path: Path) -> None:
        """Open a file; raise ``RobotError`` if it cannot be read."""
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise RobotError(f"{path}: cannot be read: {error.strerror}") from None
        self.path = path
        self.size = path.stat().st_size
        self.about: dict[str, str] = {}  # robot, version, why; set while iterating
        self.cut = False  # truncated: the writer was killed, or is still writing
        self.damaged = 0  # chunks that were skipped
        self.readable = 0  # bytes, up to the end of the last complete record
        self._channels: dict[int, mcap_codec.Channel | None] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._file.close()

    def __iter__(self) -> Iterator[RecordedMessage]:
        """Yield all messages; raise ``RobotError`` if the file is not an MCAP file."""
        for record in self._records():
            if isinstance(record, records.Metadata) and record.name == ABOUT:
                self.about = record.metadata
            elif isinstance(record, records.Channel):
                self._channels[record.id] = _channel(record)
            elif isinstance(record, records.Message):
                channel = self._channels.get(record.channel_id)
                if channel is not None:
                    yield RecordedMessage(_entry(channel, record))

    def _records(self) -> Iterator[records.McapRecord]:
        """Yield the records of the file and of its chunks, up to the truncation."""
        reader = StreamReader(self._file, emit_chunks=True, record_size_limit=RECORD_MAX)
        stream = iter(reader.records)
        while True:
            try:
                record = next(stream)
            except StopIteration:
                self.readable = self._file.tell()
                return
            except DAMAGE:
                if self.readable == 0:
                    raise RobotError(f"{self.path}: is not an MCAP file") from None
                self.cut = True
                return
            yield from self._unpacked(record)
            self.readable = self._file.tell()

    def _unpacked(self, record: records.McapRecord) -> list[records.McapRecord]:
        if not isinstance(record, records.Chunk):
            return [record]
        try:
            return breakup_chunk(record, validate_crc=True)
        except (*DAMAGE, ZstdError):
            self.damaged += 1
            return []


def _channel(record: records.Channel) -> mcap_codec.Channel | None:
    """Return a channel of the bus; None for a view."""
    if "drawn" in record.metadata:
        return None
    return mcap_codec.Channel(record.topic, None, record.metadata.get("encoding", ""))


def _entry(channel: mcap_codec.Channel, record: records.Message) -> mcap_codec.Entry:
    return mcap_codec.Entry(
        channel, record.data, record.log_time, record.publish_time, record.sequence
    )
