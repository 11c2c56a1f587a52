"""Samples to what stands in a file, and back to the very bytes.

A message is kept as JSON, so that every viewer shows it. Three names that no message of ours has
stand beside its fields:

- ``_raw``: what was attached, the board's raw frame, in base64;
- ``_payload``: the payload in base64, where the JSON alone would not give it back to the byte: a
  NaN, a payload that is no map, one that is no MessagePack at all;
- ``_deleted``: the sample was a DELETE.
"""

from base64 import b64decode, b64encode
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from common import codec, keys
from common.errors import MessageError
from common.messages import Message
from common.sample import Sample
from common.settings import Vehicle
from services.recorder import schema
from services.recorder.foxglove_views import Views
from services.recorder.schema import Schema

RAW, PAYLOAD, DELETED = OURS = ("_raw", "_payload", "_deleted")
JSON = "application/json"
UNREADABLE = (msgspec.MsgspecError, RecursionError, UnicodeError, ValueError, TypeError)
KINDS: dict[str, type[Message]] = {topic.message.__name__: topic.message for topic in keys.TOPICS}


@dataclass(frozen=True, slots=True)
class Channel:
    """Where a message stands in a file: its key on the bus, or a topic that is drawn."""

    topic: str
    schema: Schema | None  # None for what is no message of ours: viewers look into the JSON
    encoding: str = ""  # on the bus; drawn ones were never on it
    drawn: bool = False


@dataclass(frozen=True, slots=True)
class Entry:
    """A message of a file, as JSON; times on the wall clock of the recorder and of the sender."""

    channel: Channel
    data: bytes
    log_ns: int
    publish_ns: int
    sequence: int = 0


class Translator:
    """Translates for the viewers of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._views = Views(vehicle)

    def entries(self, sample: Sample, log_ns: int) -> Iterator[Entry]:
        """Yield the message, and what is drawn of it."""
        value = readable(sample)
        kind = KINDS.get(codec.kind_of(sample.encoding))
        channel = Channel(sample.key, schema.of_message(kind) if kind else None, sample.encoding)
        sent_ns, number = _whole(value, "t_ns") or log_ns, _whole(value, "seq") & 0xFFFFFFFF
        yield Entry(channel, to_json(sample, value), log_ns, sent_ns, number)
        message = _message(sample, kind)
        if message is not None:
            service = sample.key.rpartition("/")[2]
            for topic, drawn, fields in self._views.of(message, service, log_ns):
                data = msgspec.json.encode(fields)
                yield Entry(Channel(topic, drawn, drawn=True), data, log_ns, sent_ns, number)


def readable(sample: Sample) -> dict[str, Any]:
    """Return the fields of a payload; none when it has no such thing."""
    try:
        value = _codec(sample.encoding).decode(sample.payload)
    except UNREADABLE:
        return {}
    return value if isinstance(value, dict) and not set(OURS) & value.keys() else {}


def to_json(sample: Sample, value: dict[str, Any]) -> bytes:
    """Return a sample with these fields as it stands in a file."""
    extra: dict[str, Any] = {} if sample.raw is None else {RAW: b64encode(sample.raw).decode()}
    if sample.deleted:
        extra[DELETED] = True
    try:
        text = msgspec.json.encode(value)
        same = _codec(sample.encoding).encode(msgspec.json.decode(text)) == sample.payload
    except UNREADABLE:  # an extension of MessagePack, a key that JSON has not
        value, same = {}, False
    if not same:
        extra[PAYLOAD] = b64encode(sample.payload).decode()
    return msgspec.json.encode(value | extra) if extra else text


def to_sample(entry: Entry) -> Sample:
    """Return what was on the bus; raise ``MessageError`` when the entry was not made by us."""
    try:
        value: dict[str, Any] = msgspec.json.decode(entry.data, type=dict[str, Any])
        raw, payload = value.pop(RAW, None), value.pop(PAYLOAD, None)
        deleted = bool(value.pop(DELETED, False))
        return Sample(
            key=entry.channel.topic,
            payload=_codec(entry.channel.encoding).encode(value)
            if payload is None
            else b64decode(payload, validate=True),
            encoding=entry.channel.encoding,
            deleted=deleted,
            raw=None if raw is None else b64decode(raw, validate=True),
            received_ns=entry.log_ns,
            wall_ns=entry.log_ns,
        )
    except UNREADABLE as error:
        raise MessageError(f"{entry.channel.topic}: no message of the recorder: {error}") from None


def _codec(encoding: str) -> Any:
    """Return what reads and writes payloads of an encoding; MessagePack unless it says JSON."""
    return msgspec.json if encoding.startswith(JSON) else msgspec.msgpack


def _message(sample: Sample, kind: type[Message] | None) -> Message | None:
    try:
        return codec.decode(sample.payload, kind) if kind else None
    except MessageError:
        return None


def _whole(value: dict[str, Any], name: str) -> int:
    """Return a number of the header, 0 when it has none that a file can hold."""
    found = value.get(name)
    return found if isinstance(found, int) and 0 <= found < 2**63 else 0
