"""Identification of the CRC: found by trying, and not claimed without evidence."""

from typing import get_args

import pytest

from cli.wire.crc import Fit, frames, identify, names, report
from common.wire.commands import BumperQuery, DistanceQuery, MotionCommand, MotionKind
from common.wire.framing import Covers, Framing, crc_function

TELLING = [
    MotionCommand(MotionKind.RUN, 500, 300),
    MotionCommand(MotionKind.RUN, -17, 3),
    MotionCommand(MotionKind.BREAK),
]


def captured(crc: str, covers: Covers) -> list[bytes]:
    framing = Framing(crc, covers)
    return [framing.pack(frame) for frame in (*TELLING, DistanceQuery(), BumperQuery())]


def test_exactly_the_16_bit_crcs_are_tried() -> None:
    assert len(names()) >= 19
    assert {"crc-16", "modbus", "xmodem", "kermit", "x-25"} <= set(names())
    for name in names():
        assert crc_function(name)(b"123456789") <= 0xFFFF


@pytest.mark.parametrize("crc", names())
@pytest.mark.parametrize("covers", get_args(Covers))
def test_each_is_found_again(crc: str, covers: Covers) -> None:
    findings = identify(captured(crc, covers))
    assert findings.answers == [Fit(crc, covers, 5)]
    assert report(findings)[-1] == f'set: wire.crc = "{crc}", wire.crc_covers = "{covers}"'


def test_zeros_are_no_evidence() -> None:
    findings = identify(Framing().pack(frame) for frame in (DistanceQuery(), BumperQuery()))
    assert (findings.frames, findings.nonzero, findings.fits) == (2, 0, [])
    first, verdict = report(findings)
    assert "2 have an empty or all-zero payload, which is no evidence" in first
    assert verdict.startswith("inconclusive")


def test_a_frame_without_a_matching_crc() -> None:
    wrong = bytearray(Framing().pack(TELLING[0]))
    wrong[6] ^= 0xFF
    findings = identify([*captured("crc-16", "payload"), bytes(wrong)])
    assert findings.answers == []
    lines = report(findings)
    assert "crc-16 over payload: matches 5 of 6" in lines
    assert lines[-1] == "no CRC of crcmod matches every frame"


def test_several_matches_need_more_frames() -> None:
    payload = b"\x01\x00\x00\x00\x00"
    crc = crc_function("crc-16")(payload)
    findings = identify([b"GS\x0d\x00\x26\x74" + crc.to_bytes(2, "little") + payload])
    findings.fits.append(Fit("another", "payload", 1))
    assert report(findings)[-1] == "several match every frame: capture more"


def test_frames_are_found_by_magic_and_size() -> None:
    first, second = Framing().pack(TELLING[0]), Framing().pack(TELLING[1])
    inner = b"GS\xff\xff\x00\x00" + b"GS\x04\x00"  # too long, too short
    assert list(frames([b"\x01" + first + second, inner, b"", b"GS"])) == [first, second]


def test_a_magic_inside_a_frame_is_not_another_one() -> None:
    raw = Framing().pack(MotionCommand(MotionKind.RUN, int.from_bytes(b"GS", "little"), 8))
    assert list(frames([raw])) == [raw]
