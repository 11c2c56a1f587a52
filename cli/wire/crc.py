"""Identification of the CRC of captured frames: tries all 16-bit CRCs of crcmod over both ranges.

Frames are found by magic and size only. An empty payload and a payload of zeros have the CRC 0 with
every CRC that starts at zero, whatever its polynomial, so such frames are no evidence.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import get_args

import crcmod.predefined

from common.wire.frame import CRC_OFFSET, HEADER, MAGIC, PAYLOAD_OFFSET
from common.wire.framing import Covers, crc_function


@dataclass(frozen=True, slots=True)
class Fit:
    """A CRC and a range, with the number of matching frames."""

    crc: str
    covers: Covers
    frames: int


@dataclass(frozen=True, slots=True)
class Findings:
    """Result for the captured frames."""

    frames: int
    nonzero: int  # frames with a payload that is not all zeros
    fits: list[Fit]  # best first; empty without a nonzero frame

    @property
    def answers(self) -> list[Fit]:
        """The CRCs that match every frame."""
        return [fit for fit in self.fits if fit.frames == self.frames]


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


def identify(captured: Iterable[bytes]) -> Findings:
    """Try every CRC over every range on the frames."""
    found = list(captured)
    nonzero = [frame for frame in found if any(frame[PAYLOAD_OFFSET:])]
    fits = [
        Fit(name, covers, _count(name, covers, found))
        for name, covers in product(names(), get_args(Covers))
        if _count(name, covers, nonzero)
    ]
    fits.sort(key=lambda fit: (-fit.frames, fit.crc))
    return Findings(len(found), len(nonzero), fits)


def names() -> list[str]:
    """Return the 16-bit CRCs that crcmod predefines."""
    definitions = crcmod.predefined._crc_definitions  # crcmod has no public list
    return [each["name"] for each in definitions if each["poly"].bit_length() == 17]


def report(findings: Findings) -> list[str]:
    """Return the findings as text."""
    zero = findings.frames - findings.nonzero
    lines = [
        f"{findings.frames} frames; {zero} have an empty or all-zero payload, which is no "
        "evidence: its CRC is 0 with every CRC that starts at zero"
    ]
    lines += [
        f"{fit.crc} over {fit.covers}: matches {fit.frames} of {findings.frames}"
        for fit in findings.fits
    ]
    return [*lines, _verdict(findings)]


def _verdict(findings: Findings) -> str:
    if not findings.nonzero:
        return "inconclusive: capture frames with a nonzero payload, such as motion"
    if not findings.answers:
        return "no CRC of crcmod matches every frame"
    if len(findings.answers) > 1:
        return "several match every frame: capture more"
    answer = findings.answers[0]
    return f'set: wire.crc = "{answer.crc}", wire.crc_covers = "{answer.covers}"'


def _count(name: str, covers: Covers, found: Iterable[bytes]) -> int:
    crc = crc_function(name)
    header = covers == "header_and_payload"
    return sum(
        crc((frame[:CRC_OFFSET] + b"\0\0" if header else b"") + frame[PAYLOAD_OFFSET:])
        == int.from_bytes(frame[CRC_OFFSET:PAYLOAD_OFFSET], "little")
        for frame in found
    )
