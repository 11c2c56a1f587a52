"""Number formats: sign and magnitude, sides, what a frame refuses to hold."""

from collections.abc import Callable
from functools import partial
from struct import Struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import WireError
from common.wire.commands import TO_BOARD, DistanceQuery, DriverQuery, MotionCommand, MotionKind
from common.wire.frame import Frame, Side, by_opening, from_sign_magnitude, to_sign_magnitude
from common.wire.reports import FROM_BOARD, VelocityReport
from verification.harness.frame_strategies import COMMANDS, REPORTS, made


@pytest.mark.parametrize(
    ("value", "raw"),
    [(0, 0x0000), (1, 0x0001), (-1, 0x8001), (32767, 0x7FFF), (-32767, 0xFFFF), (-500, 0x81F4)],
)
def test_sign_and_magnitude(value: int, raw: int) -> None:
    assert to_sign_magnitude(value) == raw
    assert from_sign_magnitude(raw) == value


def test_minus_zero_is_read_as_zero() -> None:
    assert from_sign_magnitude(0x8000) == 0


@given(st.integers(-32767, 32767))
def test_minus_zero_is_never_sent(value: int) -> None:
    assert to_sign_magnitude(value) != 0x8000
    assert from_sign_magnitude(to_sign_magnitude(value)) == value


@pytest.mark.parametrize("make", [VelocityReport, partial(MotionCommand, MotionKind.RUN)])
@pytest.mark.parametrize(
    ("linear", "angular", "named"),
    [(32768, 0, 32768), (0, 32768, 32768), (-32768, 0, -32768), (0, -32768, -32768),
     (1, 10**9, 10**9), (-40000, 32768, -40000)],
)  # fmt: skip
def test_more_than_15_bits_is_refused(
    make: Callable[[int, int], Frame], linear: int, angular: int, named: int
) -> None:
    with pytest.raises(WireError) as refused:
        make(linear, angular)
    assert str(refused.value) == f"velocity is {named}, allowed is -32767..32767"


def test_a_frame_begins_with_magic_size_and_id() -> None:
    class Odd(Frame, frozen=True):
        ID = 0x1234
        LAYOUT = Struct("<BHH")

    assert Odd.OPENING == b"GS\x0d\x00\x34\x12"


def test_a_table_has_at_hand_what_reading_takes() -> None:
    table = by_opening(DriverQuery, DistanceQuery)
    assert [(kind.frame, kind.size) for kind in table.values()] == [
        (DriverQuery, 9),
        (DistanceQuery, 8),
    ]
    kind = table[b"GS\x09\x00\x05\x76"]
    assert kind.from_wire(kind.unpack(b"\x01")) == DriverQuery(Side.RIGHT)


def test_an_empty_frame_has_no_payload() -> None:
    assert DistanceQuery().to_bytes() == b""
    assert made(DistanceQuery, b"") == DistanceQuery()


def test_there_are_two_sides() -> None:
    assert made(DriverQuery, b"\x01").side is Side.RIGHT
    with pytest.raises(WireError, match="motor driver is 2"):
        made(DriverQuery, b"\x02")


def test_both_directions_know_the_same_eight_ids() -> None:
    ids = {0x7426, 0x7600, 0x7601, 0x7602, 0x7603, 0x7604, 0x7605, 0x7503}
    for kinds, frames in (TO_BOARD, COMMANDS), (FROM_BOARD, REPORTS):
        assert {kind.frame.ID for kind in kinds.values()} == ids
        assert {type(frame) for frame in frames} == {kind.frame for kind in kinds.values()}
