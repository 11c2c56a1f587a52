"""Payloads and attachments of ROS 2 samples, requests and replies. Pure.

A payload is XCDR1, little-endian, by the table of interfaces. A message is a tuple of its fields'
values in the order of ``definitions``: nested messages are tuples, arrays are tuples. Strings carry
their length with a closing zero byte. Every value is aligned to its size, counted from the end of
the four bytes of the encapsulation header. rmw_zenoh drops a sample without an attachment.
"""

import re
import struct
from functools import cache
from typing import Any, NamedTuple

from services.ros2.definitions import FIELDS

HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
PRIMITIVES = {
    "bool": "?", "byte": "B", "uint8": "B", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
ARRAY = re.compile(r"(.+)\[(\d*)(?:<=\d+)?\]")
MAX_ITEMS = 10_000  # of one sequence that is read; ours are short
ATTACHMENT = struct.Struct("<qqB16s")
GID_SIZE = 16

Value = Any  # a primitive, a string, or a tuple of values


class CdrError(ValueError):
    """Bytes that are no message of the expected type, or no attachment."""


class Attachment(NamedTuple):
    """The 33 bytes of an attachment."""

    sequence: int  # from 1 for each sender
    source_ns: int  # the sender's wall clock
    gid: bytes  # 16 bytes that identify the sender

    def encode(self) -> bytes:
        """Return the bytes."""
        return ATTACHMENT.pack(self.sequence, self.source_ns, GID_SIZE, self.gid)


def attachment(raw: bytes) -> Attachment:
    """Return the attachment of these bytes; raise ``CdrError``."""
    if len(raw) != ATTACHMENT.size:
        raise CdrError(f"an attachment has {ATTACHMENT.size} bytes, not {len(raw)}")
    sequence, source_ns, size, gid = ATTACHMENT.unpack(raw)
    if size != GID_SIZE:
        raise CdrError(f"a GID has {GID_SIZE} bytes, not {size}")
    return Attachment(sequence, source_ns, gid)


def encode(name: str, value: Value) -> bytes:
    """Return the payload of a message of this type."""
    out = bytearray()
    _write(out, name, value)
    return HEADER + bytes(out)


def decode(name: str, payload: bytes) -> Value:
    """Return the message of a payload; raise ``CdrError``.

    Bytes after the message are ignored: an empty message has one from ROS and none from others.
    """
    if payload[:2] != HEADER[:2]:
        raise CdrError(f"{name}: not plain little-endian CDR: {payload[:4].hex(' ')}")
    if len(payload) < len(HEADER):
        raise CdrError(f"{name}: {len(payload)} bytes are no message")
    try:
        return Reader(payload[len(HEADER) :]).read(name)
    except (struct.error, UnicodeDecodeError, CdrError) as error:
        raise CdrError(f"{name}: {error}") from None


class Reader:
    """A position in a payload, after its header."""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload
        self.at = 0

    def read(self, name: str) -> Value:
        """Return the next value of this type."""
        item, count = _split(name)
        if count is not None:
            items = count or self.read("uint32")
            if items > MAX_ITEMS:
                raise CdrError(f"a sequence of {items} items")
            return tuple([self.read(item) for _ in range(items)])
        if name == "string":
            return self._text(self.read("uint32"))
        if name not in PRIMITIVES:
            return tuple([self.read(kind) for _, kind in FIELDS[name]])
        size = struct.calcsize(PRIMITIVES[name])
        self.at += -self.at % size
        (value,) = struct.unpack_from(f"<{PRIMITIVES[name]}", self.payload, self.at)
        self.at += size
        return value

    def _text(self, size: int) -> str:
        raw = self.payload[self.at : self.at + size]
        if len(raw) != size or not raw.endswith(b"\0"):
            raise CdrError(f"a string of {size} bytes does not end")
        self.at += size
        return raw[:-1].decode()


def _write(out: bytearray, name: str, value: Value) -> None:
    """Append a value of this type."""
    item, count = _split(name)
    if count is not None:
        if count and len(value) != count:
            raise CdrError(f"{len(value)} values instead of {count}")
        if not count:
            _write(out, "uint32", len(value))
        for each in value:
            _write(out, item, each)
    elif name == "string":
        raw = value.encode() + b"\0"
        _write(out, "uint32", len(raw))
        out += raw
    elif name in PRIMITIVES:
        packed = struct.pack(f"<{PRIMITIVES[name]}", value)
        out += b"\0" * (-len(out) % len(packed)) + packed
    else:
        for (_, kind), each in zip(FIELDS[name], value, strict=True):
            _write(out, kind, each)


@cache
def _split(name: str) -> tuple[str, int | None]:
    """Return the type of an array's items and their number, 0 for any; None for no array."""
    found = ARRAY.fullmatch(name)
    return (found[1], int(found[2] or 0)) if found else (name, None)
