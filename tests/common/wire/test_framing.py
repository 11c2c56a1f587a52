"""Datagrams to frames and back: round trips, damage, garbage, resynchronisation."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.wire import framing
from common.wire import reports as reported
from common.wire.commands import TO_BOARD, DistanceQuery, DriverQuery, MotionCommand, MotionKind
from common.wire.frame import HEADER, MAGIC, OPENING, Frame, Kinds, Side
from common.wire.framing import Reason, Received, Rejected
from common.wire.reports import FROM_BOARD, LedReport
from tests.common.wire.frame_strategies import commands, read_all, reports
from verification.harness.frame_examples import COMMANDS, REPORTS

BOTH: list[tuple[Kinds, tuple[Frame, ...]]] = [(TO_BOARD, COMMANDS), (FROM_BOARD, REPORTS)]
EACH = [(kinds, frame) for kinds, frames in BOTH for frame in frames]
NAMES = [type(frame).__name__ for _, frame in EACH]
garbage = st.binary(max_size=12).filter(lambda raw: b"G" not in raw)


def header(size: int, command: int, crc: int) -> bytes:
    return HEADER.pack(OPENING.pack(MAGIC, size, command), crc)


def frames(parts: Sequence[Received | Rejected]) -> list[Frame]:
    return [part.frame for part in parts if isinstance(part, Received)]


def rejected(parts: Sequence[Received | Rejected]) -> list[Reason]:
    return [part.reason for part in parts if isinstance(part, Rejected)]


# --- whole frames ---------------------------------------------------------------------------


@given(commands, reports)
def test_every_frame_comes_back(command: Frame, report: Frame) -> None:
    for frame, kinds in (command, TO_BOARD), (report, FROM_BOARD):
        assert frames(read_all(framing.pack(frame), kinds)) == [frame]


@given(st.lists(st.tuples(garbage, reports), max_size=6), garbage)
def test_frames_with_garbage_between_are_all_found(
    pieces: list[tuple[bytes, Frame]], tail: bytes
) -> None:
    raw = b"".join(rubbish + framing.pack(frame) for rubbish, frame in pieces) + tail
    parts = read_all(raw, FROM_BOARD)
    assert frames(parts) == [frame for _, frame in pieces]
    runs = sum(bool(rubbish) for rubbish, _ in pieces) + bool(tail)
    assert rejected(parts) == [Reason.NO_MAGIC] * runs


# --- damage ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("kinds", "frame"), EACH, ids=NAMES)
def test_every_truncation_is_refused(kinds: Kinds, frame: Frame) -> None:
    raw = framing.pack(frame)
    for length in range(1, len(raw)):
        parts = read_all(raw + raw[:length], kinds)
        assert frames(parts) == [frame]
        assert rejected(parts) == [Reason.NO_MAGIC if length < 2 else Reason.TRUNCATED]


@pytest.mark.parametrize(("kinds", "frame"), EACH, ids=NAMES)
def test_every_flipped_bit_of_a_payload_is_refused(kinds: Kinds, frame: Frame) -> None:
    raw = framing.pack(frame)
    for bit in range(HEADER.size * 8, len(raw) * 8):
        damaged = bytearray(raw)
        damaged[bit // 8] ^= 1 << bit % 8
        parts = read_all(bytes(damaged), kinds)
        assert parts[0].raw.startswith(MAGIC)
        assert not frames(parts)
        assert rejected(parts)[0] is Reason.BAD_CRC


headers = st.builds(
    lambda size, command, crc, rest: header(size, command, crc) + rest,
    st.integers(0, 40) | st.integers(0, 0xFFFF),
    st.sampled_from(sorted(kind.ID for kind in FROM_BOARD.values())) | st.integers(0, 0xFFFF),
    st.just(0) | st.integers(0, 0xFFFF),
    st.binary(max_size=24) | st.integers(0, 24).map(bytes),
)


@given(st.lists(headers, max_size=4), st.booleans())
def test_almost_frames_never_raise_and_no_byte_is_lost(raw: list[bytes], to_board: bool) -> None:
    read_all(b"".join(raw), TO_BOARD if to_board else FROM_BOARD)


# --- each reason ----------------------------------------------------------------------------


def frame_bytes(command: int, payload: bytes, size: int | None = None) -> bytes:
    """Return a frame with a right CRC and any id, payload and size field."""
    crc = framing.checksum(payload)
    size = HEADER.size + len(payload) if size is None else size
    return header(size, command, crc) + payload


QUERY = "DistanceQuery has 8 bytes, its header says"
CRC = "header says 0x0001, the bytes give"
REASONS = [
    (b"\x00\x01\x02", Reason.NO_MAGIC, "does not start with 47 53"),
    (b"GS\x08\x00", Reason.TRUNCATED, "4 bytes of an 8-byte header"),
    (
        frame_bytes(0x7426, b"\x01")[:-1],
        Reason.BAD_SIZE,
        "MotionCommand has 13 bytes, its header says 9",
    ),
    (framing.pack(DriverQuery(Side.LEFT))[:-1], Reason.TRUNCATED, "8 of 9 bytes"),
    (frame_bytes(0x1234, b""), Reason.UNKNOWN_ID, "id 0x1234"),
    (frame_bytes(0x7600, b"", size=0), Reason.BAD_SIZE, f"{QUERY} 0"),
    (frame_bytes(0x7600, b"", size=0xFFFF), Reason.BAD_SIZE, f"{QUERY} 65535"),
    (b"GS\x08\x00\x00\x76\x01\x00", Reason.BAD_CRC, f"{CRC} 0x0000"),
    (
        frame_bytes(0x7605, b"\x02"),
        Reason.BAD_VALUE,
        "side is 2, allowed is 0, 1",
    ),
    (frame_bytes(0x7426, b"\x03\0\0\0\0"), Reason.BAD_VALUE, "kind is 3, allowed is 0, 1, 2"),
]


@pytest.mark.parametrize(("raw", "reason", "detail"), REASONS)
def test_each_reason_is_named_with_its_detail(raw: bytes, reason: Reason, detail: str) -> None:
    rejected = Rejected(reason, raw, detail)
    assert read_all(raw, TO_BOARD) == [rejected]
    whole = framing.pack(DistanceQuery())
    assert read_all(whole + raw, TO_BOARD) == [Received(DistanceQuery(), whole), rejected]


def test_reading_goes_on_at_the_next_magic_inside_a_bad_frame() -> None:
    inner = framing.pack(DistanceQuery())
    outer = frame_bytes(0x1234, inner)
    parts = read_all(outer, TO_BOARD)
    assert rejected(parts) == [Reason.UNKNOWN_ID]
    assert frames(parts) == [DistanceQuery()]


def test_a_magic_inside_a_good_payload_is_payload() -> None:
    frame = MotionCommand(MotionKind.RUN, int.from_bytes(b"GS", "little"), 0)
    assert MAGIC in frame.to_bytes()
    assert frames(read_all(framing.pack(frame), TO_BOARD)) == [frame]


def test_a_frame_of_the_other_direction_is_refused() -> None:
    assert rejected(read_all(framing.pack(LedReport(True)), TO_BOARD)) == [Reason.BAD_SIZE]


# --- bounded work ---------------------------------------------------------------------------

WHOLE = framing.pack(reported.BumperReport(True))
DAMAGED = WHOLE[:-1] + b"\0"
OPENED = WHOLE[:6]
FOREIGN = framing.pack(DistanceQuery())  # of the other direction


@pytest.mark.parametrize(
    ("raw", "found", "why", "steps"),
    [
        (b"GS" * 1024, 0, [Reason.UNKNOWN_ID], 1),
        (b"GS" * 32_753, 0, [Reason.UNKNOWN_ID], 1),
        (WHOLE + b"GS" * 1024 + WHOLE, 2, [Reason.UNKNOWN_ID], 3),
        (FOREIGN * 200 + WHOLE, 1, [Reason.BAD_SIZE], 2),
        (frame_bytes(0x7602, b"", size=0xFFFF) * 200, 0, [Reason.BAD_SIZE], 1),
        (DAMAGED * 7 + WHOLE, 1, [Reason.BAD_CRC] * 7, 8),
        # Dropped as a whole, with a valid frame in it
        (WHOLE + DAMAGED * 8, 0, [Reason.TOO_MANY], 9),
        (DAMAGED * 8 + WHOLE, 0, [Reason.TOO_MANY], 8),
        (DAMAGED * 200, 0, [Reason.TOO_MANY], 8),
        (OPENED * 300, 0, [Reason.TOO_MANY], 8),
        (WHOLE * 64, 64, [], 64),
        (WHOLE * 200, 0, [Reason.TOO_MANY], 65),
        (b"", 0, [], 0),
    ],
)
def test_the_work_for_a_datagram_is_bounded(
    raw: bytes, found: int, why: list[Reason], steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts: list[int] = []
    part_at = framing.part_at

    def counted(start: int, datagram: bytes, kinds: Kinds) -> Received | Rejected:
        starts.append(start)
        return part_at(start, datagram, kinds)

    monkeypatch.setattr(framing, "part_at", counted)
    parts = read_all(raw, FROM_BOARD)
    assert (len(frames(parts)), rejected(parts), len(starts)) == (found, why, steps)


# --- CRC ------------------------------------------------------------------------------------


def test_the_check_value_of_crc_16_arc() -> None:
    assert framing.checksum(b"123456789") == 0xBB3D
