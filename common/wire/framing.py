"""Encoding of frames to datagrams, and decoding.

A datagram holds one or several frames, back to back; ``frame`` documents the header.

Reading never raises. Invalid bytes become a ``Rejected`` run with one reason, and reading continues
at the next opening of a frame that the sender may send; the runs and the frames together are the
whole datagram. Valid frames take the fast path; the reason is determined only after a failure.

The work for a datagram is bounded: with ``REJECTED_MAX`` runs or more than ``PARTS_MAX`` parts it
is dropped as a whole, as one run. Valid frames in it do not count either, wherever they are: no
board packs such a datagram, and a hit is reported again within 20 ms.
"""

import re
import struct
from collections.abc import Callable
from enum import StrEnum
from functools import cache

import crcmod.predefined
import msgspec

from common.errors import WireError
from common.wire.frame import HEADER, MAGIC, OPENING, PAYLOAD_OFFSET, Frame, Kinds

# Bound here: the attribute lookup takes as long as the call itself.
pack_header, unpack_header = HEADER.pack, HEADER.unpack_from

# CRC-16/ARC, over the payload alone (from a public driver): the header is not protected.
checksum: Callable[[bytes], int] = crcmod.predefined.mkCrcFun("crc-16")


REJECTED_MAX = 8  # invalid runs of a datagram
PARTS_MAX = 64  # frames and runs; a board sends up to a dozen frames together


class Reason(StrEnum):
    """Why bytes are not a valid frame."""

    NO_MAGIC = "no_magic"
    TRUNCATED = "truncated"
    UNKNOWN_ID = "unknown_id"
    BAD_SIZE = "bad_size"
    BAD_CRC = "bad_crc"
    BAD_VALUE = "bad_value"
    TOO_MANY = "too_many_parts"


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
    start, end, rejected = 0, len(datagram), 0
    while start < end:
        part = part_at(start, datagram, kinds)
        parts.append(part)
        start += len(part.raw)
        rejected += isinstance(part, Rejected)
        if rejected >= REJECTED_MAX or len(parts) > PARTS_MAX:
            detail = f"{rejected} of its first {len(parts)} parts are invalid"
            return [Rejected(Reason.TOO_MANY, datagram, detail)]
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
        return _reject(datagram, start, kinds, *_fault(datagram, start, kinds))
    computed = checksum(payload)
    if computed != crc:
        detail = f"header says 0x{crc:04x}, the bytes give 0x{computed:04x}"
        return _reject(datagram, start, kinds, Reason.BAD_CRC, detail)
    try:
        return Received(kind.from_wire(numbers), raw)
    except WireError as error:
        return _reject(datagram, start, kinds, Reason.BAD_VALUE, str(error))


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


def _reject(datagram: bytes, start: int, kinds: Kinds, reason: Reason, detail: str) -> Rejected:
    """Reject all bytes from ``start`` to the next opening of a known frame."""
    following = _openings(*kinds).search(datagram, start + 1)
    end = following.start() if following else len(datagram)
    return Rejected(reason, datagram[start:end], detail)


@cache
def _openings(*openings: bytes) -> re.Pattern[bytes]:
    """Return the pattern of any of these openings."""
    rests = (re.escape(opening.removeprefix(MAGIC)) for opening in openings)
    return re.compile(re.escape(MAGIC) + b"(?:" + b"|".join(rests) + b")", re.DOTALL)
