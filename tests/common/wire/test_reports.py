"""The board's frames: layout, limits, what is refused."""

from collections.abc import Callable

import pytest

from common.errors import WireError
from common.wire import reports as r
from common.wire.frame import Frame, Side
from verification.harness.frame_strategies import made


@pytest.mark.parametrize(
    ("frame", "payload"),
    [
        (r.VelocityReport(500, -300), "f4012c81"),
        (r.VelocityReport(-1, 1), "01800100"),
        (r.DistanceReport(1, -1), "01000000ffffffff"),
        (r.DistanceReport(-(2**31), -1800), "00000080f8f8ffff"),
        (r.DistanceReport(2**31 - 1, 1800), "ffffff7f08070000"),
        (r.UltrasonicReport((1, 2, 3, 4, 5, 6, 7, 0xFFFF)), "0100020003000400050006000700ffff"),
        (r.BumperReport(True), "01"),
        (r.UltrasonicBrakeReport(False), "00"),
        (r.BumperBrakeReport(True), "01"),
        (r.DriverReport(Side.RIGHT, 0x80000010), "0110000080"),
        (r.LedReport(True), "55"),
        (r.LedReport(False), "aa"),
    ],
)
def test_payloads_both_ways(frame: Frame, payload: str) -> None:
    raw = bytes.fromhex(payload)
    assert frame.to_bytes() == raw
    assert made(type(frame), raw) == frame


@pytest.mark.parametrize(("byte", "pressed"), [(0, False), *((b, True) for b in range(1, 256))])
def test_every_bumper_byte_but_zero_is_pressed(byte: int, pressed: bool) -> None:
    assert made(r.BumperReport, bytes((byte,))) == r.BumperReport(pressed)


def test_a_faulty_sonar_shows_all_ones() -> None:
    assert r.SONAR_FAULT_MM == 0xFFFF


def test_minus_zero_is_zero() -> None:
    assert made(r.VelocityReport, bytes.fromhex("00800080")) == r.VelocityReport(0, 0)


@pytest.mark.parametrize(("linear", "angular"), [(32768, 0), (0, -32768)])
def test_velocity_beyond_15_bits_cannot_be_made(linear: int, angular: int) -> None:
    with pytest.raises(WireError, match="velocity"):
        r.VelocityReport(linear, angular)


@pytest.mark.parametrize("distance", [2**31, -(2**31) - 1])
def test_distance_beyond_32_bits_cannot_be_made(distance: int) -> None:
    with pytest.raises(WireError, match="distance"):
        r.DistanceReport(distance, 0)


@pytest.mark.parametrize("heading", [1801, -1801])
def test_a_heading_beyond_half_a_turn_is_refused(heading: int) -> None:
    with pytest.raises(WireError, match=r"-1800\.\.1800"):
        r.DistanceReport(0, heading)
    with pytest.raises(WireError, match=r"-1800\.\.1800"):
        made(r.DistanceReport, r.DistanceReport.LAYOUT.pack(0, heading))


@pytest.mark.parametrize("bad", [-1, 0x10000])
def test_a_range_beyond_16_bits_cannot_be_made(bad: int) -> None:
    with pytest.raises(WireError, match="ranges_mm"):
        r.UltrasonicReport((0, 0, 0, 0, 0, 0, 0, bad))


def test_there_are_eight_ranges() -> None:
    with pytest.raises(WireError, match="8 of 0"):
        r.UltrasonicReport((0,) * 7)


@pytest.mark.parametrize("bits", [-1, 2**32])
def test_fault_bits_beyond_32_cannot_be_made(bits: int) -> None:
    with pytest.raises(WireError, match="fault bits"):
        r.DriverReport(Side.LEFT, bits)


def test_a_third_driver_is_refused() -> None:
    with pytest.raises(WireError, match="motor driver is 2"):
        made(r.DriverReport, bytes([2, 0, 0, 0, 0]))


@pytest.mark.parametrize("value", [0x00, 0x01, 0x54, 0xFF])
def test_a_lamp_answer_is_done_or_failed(value: int) -> None:
    with pytest.raises(WireError, match="0x55 or 0xaa"):
        made(r.LedReport, bytes([value]))


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (
            lambda: r.VelocityReport(0, 32768),
            "velocity is 32768, allowed is -32767..32767",
        ),
        (
            lambda: r.DistanceReport(2**31, 0),
            "distance is 2147483648, allowed is 32 bits",
        ),
        (
            lambda: r.DistanceReport(0, 1801),
            "heading is 1801, allowed is -1800..1800",
        ),
        (
            lambda: r.UltrasonicReport((0,) * 7),
            f"ranges_mm is {(0,) * 7}, allowed is 8 of 0..65535",
        ),
        (
            lambda: r.UltrasonicReport((0, 0, 0, 0, 0, 0, 0, -1)),
            "ranges_mm is (0, 0, 0, 0, 0, 0, 0, -1), allowed is 8 of 0..65535",
        ),
        (
            lambda: r.DriverReport(Side.LEFT, 2**32),
            "fault bits is 4294967296, allowed is 32 bits",
        ),
        (
            lambda: made(r.DriverReport, bytes([2, 0, 0, 0, 0])),
            "motor driver is 2, allowed is 0 left, 1 right",
        ),
        (
            lambda: made(r.BumperBrakeReport, b"\x02"),
            "BumperBrakeReport is 2, allowed is 0 or 1",
        ),
        (
            lambda: made(r.LedReport, b"\x56"),
            "LED answer is 0x56, allowed is 0x55 or 0xaa",
        ),
    ],
)
def test_what_is_refused_is_told_with_its_value(make: Callable[[], Frame], text: str) -> None:
    with pytest.raises(WireError) as refused:
        make()
    assert str(refused.value) == text
