"""The relay's own reading of frames, compared with ``common.wire``."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.wire import commands, framing, reports
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.framing import Received
from services.relay import wire

RUN = framing.pack(MotionCommand(MotionKind.RUN, 500, -20))
STOP = framing.pack(MotionCommand(MotionKind.STOP))
QUERY = framing.pack(commands.BumperQuery())
SWITCH = framing.pack(commands.BumperBrakeSet(True))
HIT, CLEAR = (framing.pack(reports.BumperReport(on)) for on in (True, False))


def test_the_check_value_and_the_brake_are_those_of_the_wire() -> None:
    assert wire.crc16(b"123456789") == 0xBB3D
    assert framing.pack(MotionCommand(MotionKind.BREAK)) == wire.BRAKE


def test_a_frame_is_that_of_the_bridge() -> None:
    assert wire.frame(wire.BUMPER, b"\1") == HIT
    assert wire.frame(wire.MOTION, STOP[8:]) == STOP


@given(st.binary(max_size=40))
def test_the_crc_is_that_of_the_bridge(payload: bytes) -> None:
    assert wire.crc16(payload) == framing.checksum(payload)


@pytest.mark.parametrize(
    ("datagram", "found"),
    [
        (b"", []),
        (RUN, [RUN[8:]]),
        (QUERY, []),
        (QUERY + RUN + SWITCH + STOP, [RUN[8:], STOP[8:]]),
        (RUN[:-1], None),
        (RUN + b"G", None),
        (b"\0" + RUN, None),
        (RUN + bytes(8), None),
        (QUERY[:7], None),
        (b"X" + RUN[1:], None),
        (b"XS" + QUERY[2:], None),
        (RUN + QUERY + STOP + QUERY + RUN, [RUN[8:], STOP[8:], RUN[8:]]),
        (RUN[:6] + b"\0\0" + RUN[8:], None),
        (wire.frame(wire.MOTION, b"\1\0\0\0"), None),
        (wire.frame(0x7503, RUN), None),
        (wire.frame(0x7000, b"xx" + RUN + b"x") + STOP, None),
        (STOP + wire.frame(0x7503, RUN[:5]), [STOP[8:]]),
        (wire.frame(wire.MOTION, b"\1\0\0\0\0\0"), None),
        (wire.frame(wire.MOTION, b"\2\0\0\0\0"), [b"\2\0\0\0\0"]),
        (wire.frame(wire.MOTION, b"\3\0\0\0\0"), None),
        (b"GS\x07\0\x26\x74\0\0", None),
        (b"GS\0\0\x26\x74\0\0", None),
    ],
)
def test_a_datagram_is_valid_frames_or_nothing(datagram: bytes, found: list[bytes] | None) -> None:
    assert wire.motions(datagram) == found


@given(st.lists(st.sampled_from([RUN, STOP, QUERY, SWITCH, HIT]), max_size=4).map(b"".join),
       st.integers(0, 60), st.integers(0, 255))  # fmt: skip
def test_no_command_that_the_bridge_reads_is_overlooked(good: bytes, at: int, byte: int) -> None:
    damaged = good[:at] + bytes([byte]) + good[at + 1 :] if at < len(good) else good
    motions = wire.motions(damaged)
    if motions is None:
        return
    parts = framing.read(damaged, TO_BOARD)
    read = [p.raw[8:] for p in parts if isinstance(p, Received)]
    assert [raw for raw in read if len(raw) == wire.MOTION_SIZE] == motions


@pytest.mark.parametrize(
    ("motion", "neutral"),
    [
        (b"\0\0\0\0\0", True),
        (b"\0\1\0\0\0", True),
        (b"\1\0\0\0\0", True),
        (b"\2\1\1\1\1", True),
        (b"\1\1\0\0\0", False),
        (b"\1\0\1\0\0", False),
        (b"\1\0\0\1\0", False),
        (b"\1\0\0\0\1", False),
        (b"\1\0\x80\0\0", False),  # minus zero: a board may read it as another number
    ],
)
def test_what_is_neutral(motion: bytes, neutral: bool) -> None:
    assert wire.is_neutral(motion) == neutral


@pytest.mark.parametrize(
    ("datagram", "samples"),
    [
        (b"", []),
        (CLEAR, [False]),
        (HIT, [True]),
        (wire.frame(wire.BUMPER, b"\xff"), [True]),
        (QUERY + CLEAR + b"junk" + HIT, [False, True]),
        (HIT + CLEAR + HIT, [True, False, True]),
        (HIT[:6] + HIT, [True]),
        (HIT[:-1], []),
        (HIT[:-1] + b"\0", []),  # its CRC is of a hit
        (wire.frame(0x7603, b"\1"), []),
    ],
)
def test_bumper_answers_anywhere_in_a_datagram(datagram: bytes, samples: list[bool]) -> None:
    assert list(wire.bumper_samples(datagram)) == samples
