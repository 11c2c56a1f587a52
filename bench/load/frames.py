"""Frames of the board with plain ``struct``, without a class for each frame.

Checks what T2 checks. A bad frame raises ``ValueError`` and ends the datagram.
"""

from collections.abc import Callable, Mapping
from struct import Struct
from typing import Any

import crcmod.predefined

Values = tuple[Any, ...]

HEADER = Struct("<2sHHH")
VELOCITY = Struct("<HH")
MOTION = Struct("<BHH")
BYTE = Struct("<B")
RANGES = Struct("<8H")

crc = crcmod.predefined.mkCrcFun("crc-16")


def to_wire(value: int) -> int:
    """Return a velocity as sign and magnitude; raise ``ValueError`` beyond 15 bits."""
    if not -0x7FFF <= value <= 0x7FFF:
        raise ValueError(value)
    return value if value >= 0 else 0x8000 | -value


def from_wire(raw: int) -> int:
    """Return the velocity of a sign and magnitude."""
    return -(raw & 0x7FFF) if raw & 0x8000 else raw


def framed(command_id: int, payload: bytes) -> bytes:
    """Return a payload with its header."""
    return HEADER.pack(b"GS", 8 + len(payload), command_id, crc(payload)) + payload


def motion(values: Values) -> bytes:
    """Return a motion command; raise ``ValueError`` for an unknown kind."""
    kind, linear, angular = values
    if not 0 <= kind <= 2:
        raise ValueError(kind)
    return framed(0x7426, MOTION.pack(kind, to_wire(linear), to_wire(angular)))


def velocity_of(linear: int, angular: int) -> Values:
    """Return the values of a velocity report."""
    return from_wire(linear), from_wire(angular)


def bumper_of(value: int) -> Values:
    """Return the value of a bumper report: any byte but 0 is pressed."""
    return (value != 0,)


def ultrasonic_of(*ranges_mm: int) -> Values:
    """Return the values of an ultrasonic report."""
    return ranges_mm


Kinds = Mapping[int, tuple[Struct, Callable[..., Values]]]
REPORTS: Kinds = {
    0x7426: (VELOCITY, velocity_of),
    0x7602: (BYTE, bumper_of),
    0x7601: (RANGES, ultrasonic_of),
}


def read(datagram: bytes, kinds: Kinds) -> list[Values]:
    """Return the values of all frames of a datagram; raise ``ValueError`` for a bad one."""
    frames = []
    start, end = 0, len(datagram)
    while start < end:
        if end - start < 8:
            raise ValueError("header")
        magic, size, command_id, expected = HEADER.unpack_from(datagram, start)
        if magic != b"GS":
            raise ValueError(magic)
        kind = kinds.get(command_id)
        if kind is None:
            raise ValueError(command_id)
        layout, values_of = kind
        if size != 8 + layout.size or end - start < size:
            raise ValueError(size)
        payload = datagram[start + 8 : start + size]
        if crc(payload) != expected:
            raise ValueError(expected)
        frames.append(values_of(*layout.unpack(payload)))
        start += size
    return frames
