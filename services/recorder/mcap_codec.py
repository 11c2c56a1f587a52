"""Codec between samples of the bus and messages of an MCAP file; lossless to the byte. Pure.

A message is stored as JSON, so that every viewer can show it. Three reserved names may be added to
its fields; no message of T2 uses them:

- ``_raw``: the attachment (the board's raw frame) in base64;
- ``_payload``: the payload in base64, if the JSON alone does not restore it: a NaN, a payload that
  is not a map, or one that is not MessagePack;
- ``_deleted``: the sample was a DELETE.
"""

import re
from base64 import b64decode, b64encode
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from common.settings import Vehicle
from services.recorder.foxglove_views import FoxgloveViews, Schema, schema_of
from t2 import codec, keys
from t2.codec import Sample
from t2.errors import MessageError
from t2.messages import Message

RAW, PAYLOAD, DELETED = RESERVED = ("_raw", "_payload", "_deleted")
JSON = "application/json"
UNREADABLE = (msgspec.MsgspecError, RecursionError, UnicodeError, ValueError, TypeError)
APP = re.compile(keys.app_key("[^/]+", "[^/]+"))  # keys of a member's own
MESSAGE_TYPES: dict[str, type[Message]] = {
    topic.message.__name__: topic.message for topic in keys.TOPICS
}


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel of a file: a key of the bus, or the topic of a derived view."""

    topic: str
    schema: Schema | None  # None for messages of other programs: viewers inspect the JSON
    encoding: str = ""  # on the bus; empty for a view


@dataclass(frozen=True, slots=True)
class Entry:
    """A message of a file, as JSON; time on the recorder's wall clock."""

    channel: Channel
    data: bytes
    log_ns: int

    @property
    def key(self) -> str:
        """Return the full key, ``t2/v1/001/tel/odom/odometry``."""
        return self.channel.topic

    @property
    def kind(self) -> str:
        """Return the name of its type, ``Odometry``; empty for a type unknown to T2."""
        kind = _type_of(self.channel.topic, self.channel.encoding)
        return kind.__name__ if kind else ""

    @property
    def message(self) -> Message | None:
        """Return the decoded message; None if its type is unknown or it is invalid."""
        return _message(self.sample)

    @property
    def sample(self) -> Sample:
        """Return the sample as it was on the bus; raise ``MessageError`` for a foreign entry."""
        key, encoding = self.channel.topic, self.channel.encoding
        try:
            fields: dict[str, Any] = msgspec.json.decode(self.data, type=dict[str, Any])
            raw, payload = fields.pop(RAW, None), fields.pop(PAYLOAD, None)
            deleted = bool(fields.pop(DELETED, False))
            original = (
                _codec(encoding).encode(fields)
                if payload is None
                else b64decode(payload, validate=True)
            )
            frame = None if raw is None else b64decode(raw, validate=True)
        except UNREADABLE as error:
            raise MessageError(f"{key}: not written by the recorder: {error}") from None
        return Sample(key, original, encoding, deleted, frame, self.log_ns, self.log_ns)


class Encoder:
    """Encodes samples, with views for one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._views = FoxgloveViews(vehicle)

    def entries(self, sample: Sample, log_ns: int) -> Iterator[Entry]:
        """Yield the message, then the views derived from it."""
        fields = decode_fields(sample)
        kind = _type_of(sample.key, sample.encoding)
        channel = Channel(sample.key, schema_of(kind) if kind else None, sample.encoding)
        yield Entry(channel, encode_json(sample, fields), log_ns)
        message = _message(sample)
        if message is not None:
            service = sample.key.rpartition("/")[2]
            for topic, view_schema, view in self._views.of(message, service, log_ns):
                yield Entry(Channel(topic, view_schema), msgspec.json.encode(view), log_ns)


def decode_fields(sample: Sample) -> dict[str, Any]:
    """Return the fields of a payload; empty if it is not a map."""
    try:
        value = _codec(sample.encoding).decode(sample.payload)
    except UNREADABLE:
        return {}
    return value if isinstance(value, dict) and not set(RESERVED) & value.keys() else {}


def encode_json(sample: Sample, fields: dict[str, Any]) -> bytes:
    """Return the JSON of a sample with these fields."""
    extra: dict[str, Any] = {} if sample.raw is None else {RAW: b64encode(sample.raw).decode()}
    if sample.deleted:
        extra[DELETED] = True
    try:
        text = msgspec.json.encode(fields)
        same = _codec(sample.encoding).encode(msgspec.json.decode(text)) == sample.payload
    except UNREADABLE:  # a MessagePack extension, or a key that JSON does not support
        fields, same = {}, False
    if not same:
        extra[PAYLOAD] = b64encode(sample.payload).decode()
    return msgspec.json.encode(fields | extra) if extra else text


def _codec(encoding: str) -> Any:
    """Return the module that encodes and decodes payloads: MessagePack unless it is JSON."""
    return msgspec.json if encoding.startswith(JSON) else msgspec.msgpack


def _type_of(key: str, encoding: str) -> type[Message] | None:
    """Return the type of a message of T2; None for one of another program.

    A member chooses the encoding of its own keys, and must not place the vehicle in a view.
    """
    if APP.match(key):
        return None
    return MESSAGE_TYPES.get(codec.kind_of(encoding))


def _message(sample: Sample) -> Message | None:
    kind = _type_of(sample.key, sample.encoding)
    try:
        return codec.decode(sample.payload, kind) if kind else None
    except MessageError:
        return None
