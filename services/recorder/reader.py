"""A recording to read, whole or cut short.

    with Reader(path) as reader:
        for entry in reader:
            entry.key, entry.kind, entry.message, entry.log_ns

A file whose writer was killed ends in the middle of a chunk: all before it is read, and ``cut``
says so. A chunk that was damaged is left out, and counted.
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

# What reading raises where bytes are missing or wrong.
TORN = (McapError, struct.error, ValueError, RuntimeError, EOFError, OverflowError, MemoryError)
RECORD_MAX = 1 << 28  # bytes; a larger one is no record but damage


@dataclass(frozen=True, slots=True)
class Recorded:
    """A message of the bus as it was recorded."""

    entry: mcap_codec.Entry

    @property
    def key(self) -> str:
        """Return the whole key, ``t2/v1/001/tel/odom/odometry``."""
        return self.entry.channel.topic

    @property
    def kind(self) -> str:
        """Return the name of its type, ``Odometry``; empty when it is none of ours."""
        name = codec.kind_of(self.entry.channel.encoding)
        return name if name in mcap_codec.KINDS else ""

    @property
    def log_ns(self) -> int:
        """Return when the recorder received it, on its wall clock."""
        return self.entry.log_ns

    @property
    def message(self) -> Message | None:
        """Return it decoded; None when it is none of ours, or not as it should be."""
        kind = mcap_codec.KINDS.get(self.kind)
        if kind is None:
            return None
        try:
            return codec.decode(self.sample.payload, kind)
        except MessageError:
            return None

    @property
    def sample(self) -> Sample:
        """Return the very bytes that were on the bus."""
        return mcap_codec.to_sample(self.entry)


class Reader:
    """Yields the messages of the bus in the order in which they came, once."""

    def __init__(self, path: Path) -> None:
        """Open a file; raise ``RobotError`` when that cannot be."""
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise RobotError(f"{path}: cannot be read: {error.strerror}") from None
        self.path = path
        self.size = path.stat().st_size
        self.about: dict[str, str] = {}  # robot, version, why; known once iteration has begun
        self.cut = False  # it has no end: the writer was killed, or is still at it
        self.damaged = 0  # chunks that could not be read, and are left out
        self.readable = 0  # bytes, up to the end of the last whole record
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

    def __iter__(self) -> Iterator[Recorded]:
        """Yield them; raise ``RobotError`` for what is no MCAP file at all."""
        for record in self._records():
            if isinstance(record, records.Metadata) and record.name == ABOUT:
                self.about = record.metadata
            elif isinstance(record, records.Channel):
                self._channels[record.id] = _channel(record)
            elif isinstance(record, records.Message):
                channel = self._channels.get(record.channel_id)
                if channel is not None:
                    yield Recorded(_entry(channel, record))

    def _records(self) -> Iterator[records.McapRecord]:
        """Yield what the file's records hold, chunks taken apart, up to where it is torn."""
        reader = StreamReader(self._file, emit_chunks=True, record_size_limit=RECORD_MAX)
        stream = iter(reader.records)
        while True:
            try:
                record = next(stream)
            except StopIteration:
                self.readable = self._file.tell()
                return
            except TORN:
                if self.readable == 0:
                    raise RobotError(f"{self.path}: is no MCAP file") from None
                self.cut = True
                return
            yield from self._parts(record)
            self.readable = self._file.tell()

    def _parts(self, record: records.McapRecord) -> list[records.McapRecord]:
        if not isinstance(record, records.Chunk):
            return [record]
        try:
            return breakup_chunk(record, validate_crc=True)
        except (*TORN, ZstdError):
            self.damaged += 1
            return []


def _channel(record: records.Channel) -> mcap_codec.Channel | None:
    """Return a channel of the bus, None for what was drawn."""
    if "drawn" in record.metadata:
        return None
    return mcap_codec.Channel(record.topic, None, record.metadata.get("encoding", ""))


def _entry(channel: mcap_codec.Channel, record: records.Message) -> mcap_codec.Entry:
    return mcap_codec.Entry(
        channel, record.data, record.log_time, record.publish_time, record.sequence
    )
