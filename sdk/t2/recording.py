"""Recordings of T2: the messages of an MCAP file. Needs the extra ``recording`` of t2-sdk."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from t2.errors import T2Error
from t2.keys import ROOT, TOPICS
from t2.messages import Message

MAGIC = b"\x89MCAP0\r\n"  # at the beginning of each file
KINDS = {topic.message.__name__: topic.message for topic in TOPICS}


class Entry(NamedTuple):
    """A message of a recording."""

    key: str
    time: float  # s since 1970, by the recorder's clock
    message: "Message | dict[str, Any]"  # a dict, if its type is unknown or a value is invalid


class Recording:
    """The messages of a file, in the order of their arrival. Raises ``T2Error``.

    ``is_cut`` tells after an iteration that the file ends within a message, because its writer was
    killed or still writes, or is damaged there.

    >>> for entry in t2.Recording("recordings/001-000042-20260315-081530.mcap"):  # doctest: +SKIP
    ...     if isinstance(entry.message, t2.messages.Odometry):
    ...         print(entry.time, entry.message.x)
    """

    def __init__(self, path: str | Path) -> None:
        self.path: Path = Path(path)
        self.is_cut: bool = False

    def __iter__(self) -> Iterator[Entry]:
        try:
            from mcap.stream_reader import StreamReader
        except ImportError as error:
            raise T2Error(f"a recording needs the extra [recording] of t2-sdk: {error}") from error
        self.is_cut = False
        try:
            with self.path.open("rb") as file:
                if file.read(len(MAGIC)) != MAGIC:
                    raise T2Error(f"{self.path} is not a recording of T2")
                yield from entries(StreamReader(file, skip_magic=True).records)
        except T2Error:
            raise
        except OSError as error:
            raise T2Error(f"{self.path}: cannot be read: {error.strerror}") from error
        except Exception:  # of many types: the reader of MCAP takes damaged data for valid
            self.is_cut = True


def entries(records: Iterable[Any]) -> Iterator[Entry]:
    """Yield the messages of the bus, without the views for Foxglove."""
    from mcap.records import Channel
    from mcap.records import Message as Record

    channels: dict[int, Channel] = {}
    for record in records:
        if isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Record):
            channel = channels[record.channel_id]
            kind = channel.metadata.get("encoding", "").rpartition(".")[2]
            if channel.topic.startswith(f"{ROOT}/"):
                message = decoded(record.data, KINDS.get(kind))
                yield Entry(channel.topic, record.log_time / 1e9, message)


def decoded(data: bytes, kind: type[Message] | None) -> Message | dict[str, Any]:
    """Return a message of this type, or what it has of fields."""
    if kind is not None:
        try:
            return msgspec.json.decode(data, type=kind)
        except msgspec.ValidationError:
            pass
    fields: dict[str, Any] = msgspec.json.decode(data, type=dict[str, Any])
    return fields
