"""Number formats: sign and magnitude, sides, what a frame refuses to hold."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import WireError
from common.wire.commands import TO_BOARD, DistanceQuery, DriverQuery
from common.wire.frame import Frame, Side, from_sign_magnitude, to_sign_magnitude
from common.wire.reports import FROM_BOARD
from tests.wire.strategies import COMMANDS, REPORTS


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


@pytest.mark.parametrize("value", [32768, -32768, 10**9])
def test_more_than_15_bits_is_refused(value: int) -> None:
    with pytest.raises(WireError, match=rf"velocity is {value}, allowed is -32767\.\.32767"):
        to_sign_magnitude(value)


@pytest.mark.parametrize("kind", [type(frame) for frame in (*COMMANDS, *REPORTS)])
def test_a_payload_of_another_size_is_refused(kind: type[Frame]) -> None:
    size = kind.LAYOUT.size
    for wrong in {0, size - 1, size + 1} - {size, -1}:
        with pytest.raises(WireError, match=f"{kind.__name__} payload size is {wrong}"):
            kind.from_bytes(b"\x00" * wrong)


def test_an_empty_frame_has_no_payload() -> None:
    assert DistanceQuery().to_bytes() == b""
    assert DistanceQuery.from_bytes(b"") == DistanceQuery()


def test_there_are_two_sides() -> None:
    assert DriverQuery.from_bytes(b"\x01").side is Side.RIGHT
    with pytest.raises(WireError, match="motor driver is 2"):
        DriverQuery.from_bytes(b"\x02")


def test_both_directions_know_the_same_eight_ids() -> None:
    ids = {0x7426, 0x7600, 0x7601, 0x7602, 0x7603, 0x7604, 0x7605, 0x7503}
    assert set(TO_BOARD) == set(FROM_BOARD) == ids
    assert {type(frame) for frame in COMMANDS} == set(TO_BOARD.values())
    assert {type(frame) for frame in REPORTS} == set(FROM_BOARD.values())
