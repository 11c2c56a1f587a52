"""Frames byte for byte, both ways; the values that they refuse to hold."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from common.errors import WireError
from common.wire import commands as c
from common.wire import framing
from common.wire import reports as r
from common.wire.frame import OCTET, VELOCITY, Frame, Side
from common.wire.framing import Received
from tests.common.wire.frame_strategies import made, read_all
from verification.harness.frame_examples import COMMANDS, REPORTS

# As the public driver of this vehicle sends them.
GOLDEN = json.loads((Path(__file__).parent / "frames.json").read_text(encoding="utf-8"))
BY_NAME = {each["name"]: each for each in GOLDEN["pc_to_board"]}
RUN = partial(c.MotionCommand, c.MotionKind.RUN)


def frame_of(each: dict[str, Any]) -> Frame:
    """Build the frame that a golden line describes."""
    if "cmd" in each:
        return c.MotionCommand(c.MotionKind(each["cmd"]), each["linear_mmps"], each["angular_raw"])
    if "side" in each:
        return c.DriverQuery(Side(each["side"]))
    if "fields" in each:
        return c.LedSet(*each["fields"])
    frames: dict[str, Frame] = {
        "query distance": c.DistanceQuery(),
        "query ultrasonic": c.UltrasonicQuery(),
        "query bumper": c.BumperQuery(),
        "set bumper brake on": c.BumperBrakeSet(True),
    }
    return frames[each["name"]]


@pytest.mark.parametrize("name", BY_NAME)
def test_golden_bytes_both_ways(name: str) -> None:
    each = BY_NAME[name]
    frame, raw = frame_of(each), bytes.fromhex(each["hex"])
    assert framing.pack(frame) == raw
    assert read_all(raw, c.TO_BOARD) == [Received(frame, raw)]


@pytest.mark.parametrize(
    ("frame", "payload"),
    [
        (c.MotionCommand(c.MotionKind.STOP), "0000000000"),
        (RUN(500, -32767), "01f401ffff"),
        (RUN(-32767, 32767), "01ffffff7f"),
        (c.DistanceQuery(), ""),
        (c.UltrasonicBrakeSet(True), "01"),
        (c.UltrasonicBrakeSet(False), "00"),
        (c.DriverQuery(Side.RIGHT), "01"),
        (c.LedSet(0, 0, 10, 255, 0, 0, 0, 0, 0), "00000aff0000000000"),
        (r.VelocityReport(500, -300), "f4012c81"),
        (r.VelocityReport(-1, 1), "01800100"),
        (r.VelocityReport(32767, -32767), "ff7fffff"),
        (r.DistanceReport(1, -1), "01000000ffffffff"),
        (r.DistanceReport(-(2**31), -1800), "00000080f8f8ffff"),
        (r.DistanceReport(2**31 - 1, 1800), "ffffff7f08070000"),
        (
            r.UltrasonicReport((1, 2, 3, 4, 5, 6, 7, r.SONAR_FAULT_MM)),
            "0100020003000400050006000700ffff",
        ),
        (r.BumperReport(True), "01"),
        (r.UltrasonicBrakeReport(False), "00"),
        (r.BumperBrakeReport(True), "01"),
        (r.DriverReport(Side.RIGHT, 0x80000010), "0110000080"),
        (r.DriverReport(Side.LEFT, 2**32 - 1), "00ffffffff"),
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


def test_minus_zero_is_read_as_zero() -> None:
    assert made(r.VelocityReport, bytes.fromhex("00800080")) == r.VelocityReport(0, 0)


# --- refusals -----------------------------------------------------------------------------------


def lamp(field: int, value: int) -> Frame:
    """Build the frame of a lamp with zeros in its other fields."""
    return c.LedSet(*(value if n == field else 0 for n in range(9)))


REFUSED: list[tuple[Callable[[], Frame], str]] = [
    *(
        (partial(make, *values), f"{field} is {value}, allowed is -32767..32767")
        for make in (r.VelocityReport, RUN)
        for value in (32768, -32768, 10**9)
        for field, values in (("linear_mmps", (value, 0)), ("angular_raw", (0, value)))
    ),
    *(
        (partial(lamp, n, value), f"{name} is {value}, allowed is 0..")
        for n, name in enumerate(c.LedSet.__struct_fields__)
        for value in (-1, 256)
    ),
    (partial(lamp, 2, 11), "on_lightness is 11, allowed is 0..10"),
    (partial(c.MotionCommand, 9), "kind is 9, allowed is 0, 1, 2"),  # type: ignore[arg-type]
    (partial(c.BumperBrakeSet, 2), "on is 2, allowed is 0, 1"),  # type: ignore[arg-type]
    *(
        (partial(r.DistanceReport, mm, 0), f"distance_mm is {mm}, allowed is -2147483648..21474836")
        for mm in (2**31, -(2**31) - 1)
    ),
    *(
        (partial(r.DistanceReport, 0, n), f"heading_ddeg is {n}, allowed is -1800..1800")
        for n in (1801, -1801)
    ),
    *(
        (partial(r.UltrasonicReport, some), f"ranges_mm is {some}, allowed is 8 of 0..65535")
        for some in ((0,) * 7, (0,) * 9, (*(0,) * 7, -1), (*(0,) * 7, 0x10000))
    ),
    *(
        (partial(r.DriverReport, Side.LEFT, n), f"fault_bits is {n}, allowed is 0..4294967295")
        for n in (-1, 2**32)
    ),
    # From the wire.
    *(
        (partial(made, c.MotionCommand, bytes([kind, 0, 0, 0, 0])),
         f"kind is {kind}, allowed is 0, 1, 2")
        for kind in (3, 0x80, 255)
    ),
    *(
        (partial(made, kind, bytes([value])), f"on is {value}, allowed is 0, 1")
        for kind in (c.BumperBrakeSet, r.UltrasonicBrakeReport)
        for value in (2, 0x80, 255)
    ),
    (partial(made, c.DriverQuery, b"\2"), "side is 2, allowed is 0, 1"),
    (partial(made, r.DriverReport, b"\2" + bytes(4)), "side is 2, allowed is 0, 1"),
    *(
        (partial(made, r.LedReport, bytes([n])), f"done is {n}, allowed is 85, 170")
        for n in (0x00, 0x01, 0x54, 0xFF)
    ),
    (partial(made, r.DistanceReport, r.DistanceReport.LAYOUT.pack(0, 1801)), "heading_ddeg is"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "text"), REFUSED)
def test_what_the_wire_cannot_carry_is_refused(make: Callable[[], Frame], text: str) -> None:
    with pytest.raises(WireError) as refused:
        make()
    assert str(refused.value).startswith(text)


# --- the tables of frames -----------------------------------------------------------------------


def test_a_frame_begins_with_magic_size_and_id() -> None:
    class Odd(Frame, frozen=True):
        ID = 0x1234
        FIELDS = (OCTET, VELOCITY, VELOCITY)

    assert Odd.OPENING == b"GS\x0d\x00\x34\x12"


def test_both_directions_know_the_same_eight_ids() -> None:
    ids = {0x7426, 0x7600, 0x7601, 0x7602, 0x7603, 0x7604, 0x7605, 0x7503}
    for kinds, frames in (c.TO_BOARD, COMMANDS), (r.FROM_BOARD, REPORTS):
        assert {kind.ID for kind in kinds.values()} == ids
        assert {type(frame) for frame in frames} == set(kinds.values())
