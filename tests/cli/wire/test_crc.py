"""Identification of the CRC: found by trying, and not claimed without evidence."""

from typing import get_args

from cli.wire.crc import Fit, frames, identify, names, verdict
from common.wire.commands import BumperQuery, DistanceQuery, MotionCommand, MotionKind
from common.wire.framing import Covers, Framing

TELLING = [
    MotionCommand(MotionKind.RUN, 500, 300),
    MotionCommand(MotionKind.RUN, -17, 3),
    MotionCommand(MotionKind.BREAK),
]


def captured(crc: str, covers: Covers) -> list[bytes]:
    framing = Framing(crc, covers)
    return [framing.pack(frame) for frame in (*TELLING, DistanceQuery(), BumperQuery())]


def test_a_crc_is_found_again() -> None:
    usual = {"crc-16", "modbus", "xmodem", "kermit", "x-25"}
    assert usual <= set(names())
    for covers in get_args(Covers):
        for crc in usual:
            fits = identify(captured(crc, covers))
            assert fits[0] == Fit(crc, covers, 5)
            text = f'set: wire.crc = "{crc}", wire.crc_covers = "{covers}"'
            assert verdict(fits, 5) == (text, True)


def test_zeros_are_no_evidence() -> None:
    fits = identify([Framing().pack(frame) for frame in (DistanceQuery(), BumperQuery())])
    assert fits == []
    assert verdict(fits, 2)[1] is False


def test_a_frame_without_a_matching_crc() -> None:
    wrong = bytearray(Framing().pack(TELLING[0]))
    wrong[6] ^= 0xFF
    fits = identify([*captured("crc-16", "payload"), bytes(wrong)])
    assert fits[0] == Fit("crc-16", "payload", 5)
    assert verdict(fits, 6) == ("no CRC of crcmod matches every frame", False)


def test_several_matches_need_more_frames() -> None:
    fits = [Fit("a", "payload", 1), Fit("b", "payload", 1)]
    assert verdict(fits, 1) == ("several match every frame: capture more", True)


def test_frames_are_found_by_magic_and_size() -> None:
    first, second = Framing().pack(TELLING[0]), Framing().pack(TELLING[1])
    inner = b"GS\xff\xff\x00\x00" + b"GS\x04\x00"  # too long, too short
    assert list(frames([b"\x01" + first + second, inner, b"", b"GS"])) == [first, second]
    # A magic inside a frame is not another one.
    raw = Framing().pack(MotionCommand(MotionKind.RUN, int.from_bytes(b"GS", "little"), 8))
    assert list(frames([raw])) == [raw]
