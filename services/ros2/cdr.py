"""Payloads of ROS 2: XCDR1, little-endian, by the table of interfaces. Pure.

A message is a tuple of its fields' values in the order of ``definitions``: nested messages are
tuples, arrays are tuples. Strings carry their length with a closing zero byte. Every value is
aligned to its size, counted from the end of the four bytes of the encapsulation header.
"""

import re
import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from services.ros2.definitions import FIELDS

HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
PRIMITIVES = {
    "bool": "?", "byte": "B", "uint8": "B", "int32": "i", "uint32": "I",
    "float32": "f", "float64": "d",
}  # fmt: skip
ARRAY = re.compile(r"(.+)\[(\d*)\]")
MAX_ITEMS = 10_000  # of one sequence that is read; ours are short

Value = Any  # a primitive, a string, or a tuple of values
Write = Callable[[bytearray, Value], None]
Read = Callable[["Reader"], Value]


class CdrError(ValueError):
    """Bytes that are no message of the expected type."""


def encode(name: str, value: Value) -> bytes:
    """Return the payload of a message of this type."""
    out = bytearray(HEADER)
    _writer(name)(out, value)
    return bytes(out)


def decode(name: str, payload: bytes) -> Value:
    """Return the message of a payload; raise ``CdrError``.

    Bytes after the message are ignored: an empty message has one from ROS and none from others.
    """
    if payload[:2] != HEADER[:2]:
        raise CdrError(f"{name}: not plain little-endian CDR: {payload[:4].hex(' ')}")
    if len(payload) < len(HEADER):
        raise CdrError(f"{name}: {len(payload)} bytes are no message")
    reader = Reader(payload[len(HEADER) :])
    try:
        return _reader(name)(reader)
    except (struct.error, UnicodeDecodeError, CdrError) as error:
        raise CdrError(f"{name}: {error}") from None


class Reader:
    """A position in a payload, after its header."""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload
        self.at = 0

    def take(self, code: str) -> Value:
        """Return the next primitive."""
        size = struct.calcsize(code)
        self.at += -self.at % size
        (value,) = struct.unpack_from(f"<{code}", self.payload, self.at)
        self.at += size
        return value

    def text(self) -> str:
        """Return the next string."""
        size = self.take("I")
        raw = self.payload[self.at : self.at + size]
        if len(raw) != size or not raw.endswith(b"\0"):
            raise CdrError(f"a string of {size} bytes does not end")
        self.at += size
        return raw[:-1].decode()


@cache
def _writer(name: str) -> Write:
    """Return the function that appends a value of this type."""
    item, count = _split(name)
    if count is not None:
        return _write_items(_writer(item), count)
    if name == "string":
        return _write_string
    if name in PRIMITIVES:
        code = PRIMITIVES[name]
        size = struct.calcsize(code)

        def write(out: bytearray, value: Value) -> None:
            out += b"\0" * (-(len(out) - len(HEADER)) % size) + struct.pack(f"<{code}", value)

        return write
    fields = [_writer(kind) for _, kind in FIELDS[name]]

    def write_all(out: bytearray, values: Value) -> None:
        for write_field, value in zip(fields, values, strict=True):
            write_field(out, value)

    return write_all


def _write_string(out: bytearray, value: str) -> None:
    raw = value.encode() + b"\0"
    _writer("uint32")(out, len(raw))
    out += raw


def _write_items(write: Write, count: int) -> Write:
    def write_items(out: bytearray, values: Value) -> None:
        if count and len(values) != count:
            raise CdrError(f"{len(values)} values instead of {count}")
        if not count:
            _writer("uint32")(out, len(values))
        for value in values:
            write(out, value)

    return write_items


@cache
def _reader(name: str) -> Read:
    """Return the function that reads a value of this type."""
    item, count = _split(name)
    if count is not None:
        return _read_items(_reader(item), count)
    if name == "string":
        return Reader.text
    if name in PRIMITIVES:
        code = PRIMITIVES[name]
        return lambda reader: reader.take(code)
    fields = [_reader(kind) for _, kind in FIELDS[name]]
    return lambda reader: tuple([read(reader) for read in fields])


def _read_items(read: Read, count: int) -> Read:
    def read_items(reader: Reader) -> Value:
        items = count or reader.take("I")
        if items > MAX_ITEMS:
            raise CdrError(f"a sequence of {items} items")
        return tuple([read(reader) for _ in range(items)])

    return read_items


def _split(name: str) -> tuple[str, int | None]:
    """Return the type of an array's items and their number, 0 for any; None for no array."""
    found = ARRAY.fullmatch(name)
    return (found[1], int(found[2] or 0)) if found else (name, None)
