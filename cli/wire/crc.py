"""Identification of the CRC of captured frames: tries all 16-bit CRCs of crcmod over both ranges.

Frames are found by magic and size only. An empty payload and a payload of zeros have the CRC 0 with
every CRC that starts at zero, whatever its polynomial, so such frames are no evidence.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import NamedTuple, get_args

import crcmod.predefined

from common.wire.frame import CRC_OFFSET, HEADER, MAGIC, PAYLOAD_OFFSET
from common.wire.framing import Covers, crc_function


class Fit(NamedTuple):
    """A CRC and a range, with the number of matching frames."""

    crc: str
    covers: Covers
    frames: int


def frames(datagrams: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the frames, by magic and size."""
    for datagram in datagrams:
        start = datagram.find(MAGIC)
        while start >= 0:
            size = int.from_bytes(datagram[start + 2 : start + 4], "little")
            whole = HEADER.size <= size <= len(datagram) - start
            if whole:
                yield datagram[start : start + size]
            start = datagram.find(MAGIC, start + (size if whole else 1))


def names() -> list[str]:
    """Return the 16-bit CRCs that crcmod predefines."""
    definitions = crcmod.predefined._crc_definitions  # crcmod has no public list
    return [each["name"] for each in definitions if each["poly"].bit_length() == 17]


def identify(found: Sequence[bytes]) -> list[Fit]:
    """Return the CRCs that match a frame with a payload that is not all zeros, best first."""
    nonzero = [frame for frame in found if any(frame[PAYLOAD_OFFSET:])]
    fits = [
        Fit(name, covers, _count(name, covers, found))
        for name, covers in product(names(), get_args(Covers))
        if _count(name, covers, nonzero)
    ]
    return sorted(fits, key=lambda fit: (-fit.frames, fit.crc))


def verdict(fits: Sequence[Fit], count: int) -> tuple[str, bool]:
    """Return what the fits of ``count`` frames show, and whether it is one or more CRCs."""
    answers = [fit for fit in fits if fit.frames == count]
    if not fits:
        return "no CRC of crcmod matches a frame with a nonzero payload, such as motion", False
    if not answers:
        return "no CRC of crcmod matches every frame", False
    if len(answers) > 1:
        return "several match every frame: capture more", True
    return f'set: wire.crc = "{answers[0].crc}", wire.crc_covers = "{answers[0].covers}"', True


def _count(name: str, covers: Covers, found: Iterable[bytes]) -> int:
    crc = crc_function(name)
    header = covers == "header_and_payload"
    return sum(
        crc((frame[:CRC_OFFSET] + b"\0\0" if header else b"") + frame[PAYLOAD_OFFSET:])
        == int.from_bytes(frame[CRC_OFFSET:PAYLOAD_OFFSET], "little")
        for frame in found
    )
