"""The frames that the relay must know: motion commands and bumper answers. Pure.

``common.wire.frame`` shows the layout. This module repeats a part of it on purpose: the relay
imports nothing of T2, so that a mistake there is not a mistake here.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator

MAGIC = b"GS"
HEADER = struct.Struct("<2sHHH")  # magic, size of the whole frame, id, CRC of the payload
MOTION, BUMPER = 0x7426, 0x7602
RUN, HALT = 1, 2  # kinds of a motion command; 0 is STOP, HALT is BRAKE (manual 2.2)
MOTION_SIZE = 5  # of the payload: u8 kind, u16 linear, u16 angular
MOTION_OPENING = HEADER.pack(MAGIC, HEADER.size + MOTION_SIZE, MOTION, 0)[:6]  # without the CRC


def crc16(payload: bytes) -> int:
    """Return CRC-16/ARC: reflected 0x8005, start 0, no final XOR."""
    crc = 0
    for byte in payload:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def frame(command: int, payload: bytes) -> bytes:
    """Return a whole frame."""
    return HEADER.pack(MAGIC, HEADER.size + len(payload), command, crc16(payload)) + payload


BRAKE = frame(MOTION, bytes([HALT, 0, 0, 0, 0]))
SAMPLES = frozenset(frame(BUMPER, bytes([pressed])) for pressed in range(256))
SAMPLE_SIZE = HEADER.size + 1
SAMPLE_OPENING = re.compile(re.escape(HEADER.pack(MAGIC, SAMPLE_SIZE, BUMPER, 0)[:6]))


def motions(datagram: bytes) -> list[bytes] | None:
    """Return the payload of each motion command; None unless all is valid frames back to back.

    A motion command of another size or kind, or inside another frame, is invalid, too.
    """
    found, rest = [], datagram
    while rest:
        if len(rest) < HEADER.size:
            return None
        magic, size, command, crc = HEADER.unpack_from(rest)
        payload = rest[HEADER.size : size]
        if magic != MAGIC or len(payload) != size - HEADER.size or crc16(payload) != crc:
            return None
        if command == MOTION:
            if len(payload) != MOTION_SIZE or payload[0] > HALT:
                return None
            found.append(payload)
        rest = rest[size:]
    return found if datagram.count(MOTION_OPENING) == len(found) else None  # none in a payload


def is_neutral(motion: bytes) -> bool:
    """Return whether a command begins no motion: STOP, BRAKE, or RUN with velocities 0x0000."""
    return motion[0] != RUN or not any(motion[1:])


def bumper_samples(datagram: bytes) -> Iterator[bool]:
    """Yield whether the bumper is pressed, for each bumper answer anywhere in a datagram."""
    for opening in SAMPLE_OPENING.finditer(datagram):
        answer = datagram[opening.start() :][:SAMPLE_SIZE]
        if answer in SAMPLES:
            yield answer[-1] != 0
