"""The board's frames as ``ctypes`` structures: the layout is declared, the checks are by hand."""

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

from bench.codec.candidate import Candidate, readers, writers
from bench.codec.frame_struct import Values, crc, from_wire, only, to_wire


class Header(ctypes.LittleEndianStructure):
    """What every frame begins with."""

    _pack_ = 1
    _fields_ = (
        ("magic", ctypes.c_char * 2),
        ("size", ctypes.c_uint16),
        ("id", ctypes.c_uint16),
        ("crc", ctypes.c_uint16),
    )


class Velocity(ctypes.LittleEndianStructure):
    """Payload of a velocity report."""

    _pack_ = 1
    _fields_ = (("linear", ctypes.c_uint16), ("angular", ctypes.c_uint16))


class Motion(ctypes.LittleEndianStructure):
    """Payload of a motion command."""

    _pack_ = 1
    _fields_ = (
        ("kind", ctypes.c_uint8),
        ("linear", ctypes.c_uint16),
        ("angular", ctypes.c_uint16),
    )


class Bumper(ctypes.LittleEndianStructure):
    """Payload of a bumper report."""

    _pack_ = 1
    _fields_ = (("pressed", ctypes.c_uint8),)


class Ultrasonic(ctypes.LittleEndianStructure):
    """Payload of an ultrasonic report."""

    _pack_ = 1
    _fields_ = (("ranges", ctypes.c_uint16 * 8),)


def framed(command_id: int, payload: ctypes.LittleEndianStructure) -> bytes:
    """Return a payload with its header."""
    body = bytes(payload)
    return bytes(Header(b"GS", 8 + len(body), command_id, crc(body))) + body


def velocity(values: Values) -> bytes:
    """Return a velocity report."""
    linear, angular = values
    return framed(0x7426, Velocity(to_wire(linear), to_wire(angular)))


def motion(values: Values) -> bytes:
    """Return a motion command; raise ``ValueError`` for one that there is not."""
    kind, linear, angular = values
    if not 0 <= kind <= 2:
        raise ValueError(kind)
    return framed(0x7426, Motion(kind, to_wire(linear), to_wire(angular)))


def bumper(values: Values) -> bytes:
    """Return a bumper report."""
    return framed(0x7602, Bumper(*values))


def ultrasonic(values: Values) -> bytes:
    """Return an ultrasonic report; ``ctypes`` cuts numbers off, so they are checked here."""
    if len(values) != 8:
        raise ValueError(len(values))
    for value in values:
        if not 0 <= value <= 0xFFFF:
            raise ValueError(value)
    return framed(0x7601, Ultrasonic(values))


def velocity_of(it: Velocity) -> Values:
    """Return the values of a velocity report."""
    return from_wire(it.linear), from_wire(it.angular)


def motion_of(it: Motion) -> Values:
    """Return the values of a motion command; raise ``ValueError`` for one that there is not."""
    if it.kind > 2:
        raise ValueError(it.kind)
    return it.kind, from_wire(it.linear), from_wire(it.angular)


def bumper_of(it: Bumper) -> Values:
    """Return the value of a bumper report: any byte but 0 is pressed."""
    return (it.pressed != 0,)


def ultrasonic_of(it: Ultrasonic) -> Values:
    """Return the values of an ultrasonic report."""
    return tuple(it.ranges)


Kinds = Mapping[int, tuple[type[ctypes.LittleEndianStructure], int, Callable[[Any], Values]]]
REPORTS: Kinds = {
    0x7426: (Velocity, ctypes.sizeof(Velocity), velocity_of),
    0x7602: (Bumper, ctypes.sizeof(Bumper), bumper_of),
    0x7601: (Ultrasonic, ctypes.sizeof(Ultrasonic), ultrasonic_of),
}
COMMANDS: Kinds = {0x7426: (Motion, ctypes.sizeof(Motion), motion_of)}


def read(datagram: bytes, kinds: Kinds) -> list[Values]:
    """Return the values of all frames of a datagram; raise ``ValueError`` for a bad one."""
    frames = []
    start, end = 0, len(datagram)
    while start < end:
        header = Header.from_buffer_copy(datagram, start)  # raises where it does not fit
        if header.magic != b"GS":
            raise ValueError(header.magic)
        kind = kinds.get(header.id)
        if kind is None:
            raise ValueError(header.id)
        structure, length, values_of = kind
        size = 8 + length
        if header.size != size:
            raise ValueError(header.size)
        payload = structure.from_buffer_copy(datagram, start + 8)
        if crc(datagram[start + 8 : start + size]) != header.crc:
            raise ValueError(header.crc)
        frames.append(values_of(payload))
        start += size
    return frames


def _report(datagram: bytes) -> list[Values]:
    return read(datagram, REPORTS)


def _command(datagram: bytes) -> list[Values]:
    return read(datagram, COMMANDS)


CTYPES = Candidate(
    name="ctypes",
    encode=writers(velocity, motion, bumper, ultrasonic),
    decode=readers(_report, _command),
    plain=only,
)
