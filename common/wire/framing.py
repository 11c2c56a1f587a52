"""Encoding of frames to datagrams, and decoding.

A datagram holds one or several frames, back to back; ``frame`` documents the header.

Reading never raises. Invalid bytes become a ``Rejected`` run with one reason, and reading continues
at the next magic; the runs and the frames together are the whole datagram. Valid frames take the
fast path; the reason is determined only after a failure.
"""

import struct
from collections.abc import Callable
from enum import StrEnum

import crcmod.predefined
import msgspec

from common.errors import WireError
from common.wire.frame import HEADER, MAGIC, OPENING, PAYLOAD_OFFSET, Frame, Kinds

# Bound here: the attribute lookup takes as long as the call itself.
pack_header, unpack_header = HEADER.pack, HEADER.unpack_from

# CRC-16/ARC, over the payload alone (from a public driver): the header is not protected.
checksum: Callable[[bytes], int] = crcmod.predefined.mkCrcFun("crc-16")


class Reason(StrEnum):
    """Why bytes are not a valid frame."""

    NO_MAGIC = "no_magic"
    TRUNCATED = "truncated"
    UNKNOWN_ID = "unknown_id"
    BAD_SIZE = "bad_size"
    BAD_CRC = "bad_crc"
    BAD_VALUE = "bad_value"


class Received(msgspec.Struct, frozen=True, gc=False):
    """A frame of a datagram, with header and payload in ``raw``."""

    frame: Frame
    raw: bytes


class Rejected(msgspec.Struct, frozen=True, gc=False):
    """A run of invalid bytes, with the reason."""

    reason: Reason
    raw: bytes
    detail: str


def pack(frame: Frame) -> bytes:
    """Return the frame with its header."""
    payload = frame.to_bytes()
    return pack_header(frame.OPENING, checksum(payload)) + payload


def read(datagram: bytes, kinds: Kinds) -> list[Received | Rejected]:
    """Return the parts of a datagram, in order; ``kinds`` are the frames of its sender."""
    parts: list[Received | Rejected] = []
    start, end = 0, len(datagram)
    for _ in datagram:  # bounded: each part has at least one byte
        part = part_at(start, datagram, kinds)
        parts.append(part)
        start += len(part.raw)
        if start == end:
            break
    return parts


def part_at(start: int, datagram: bytes, kinds: Kinds) -> Received | Rejected:
    """Return the frame that begins at ``start``, or the run of invalid bytes."""
    try:
        opening, crc = unpack_header(datagram, start)
        kind = kinds[opening]
        raw = datagram[start : start + kind.SIZE]
        payload = raw[PAYLOAD_OFFSET:]
        numbers = kind.LAYOUT.unpack(payload)
    except (struct.error, KeyError):  # truncated, or no known frame begins here
        return _reject(datagram, start, *_fault(datagram, start, kinds))
    computed = checksum(payload)
    if computed != crc:
        detail = f"header says 0x{crc:04x}, the bytes give 0x{computed:04x}"
        return _reject(datagram, start, Reason.BAD_CRC, detail)
    try:
        return Received(kind.from_wire(numbers), raw)
    except WireError as error:
        return _reject(datagram, start, Reason.BAD_VALUE, str(error))


def _fault(datagram: bytes, start: int, kinds: Kinds) -> tuple[Reason, str]:
    """Return why no complete frame of these kinds begins at ``start``."""
    if not datagram.startswith(MAGIC, start):
        return Reason.NO_MAGIC, f"does not start with {MAGIC.hex(' ')}"
    left = len(datagram) - start
    if left < HEADER.size:
        return Reason.TRUNCATED, f"{left} bytes of an 8-byte header"
    _, size, command_id = OPENING.unpack_from(datagram, start)
    kind = {kind.ID: kind for kind in kinds.values()}.get(command_id)
    if kind is None:
        return Reason.UNKNOWN_ID, f"id 0x{command_id:04x}"
    if size != kind.SIZE:
        text = f"{kind.__name__} has {kind.SIZE} bytes, its header says {size}"
        return Reason.BAD_SIZE, text
    return Reason.TRUNCATED, f"{left} of {size} bytes"


def _reject(datagram: bytes, start: int, reason: Reason, detail: str) -> Rejected:
    """Reject all bytes from ``start`` to the next magic."""
    following = datagram.find(MAGIC, start + 1)
    end = len(datagram) if following == -1 else following
    return Rejected(reason, datagram[start:end], detail)
