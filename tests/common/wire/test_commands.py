"""The PC's frames, byte for byte as the public driver of this vehicle sends them."""

import json
from pathlib import Path
from typing import Any

import pytest

from common.errors import WireError
from common.wire import commands as c
from common.wire.frame import Frame, Side
from common.wire.framing import Framing, Received
from verification.harness.frame_strategies import made, read_all

GOLDEN = json.loads((Path(__file__).parent / "frames.json").read_text(encoding="utf-8"))
BY_NAME = {each["name"]: each for each in GOLDEN["pc_to_board"]}


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
    framing = Framing()
    assert framing.pack(frame) == raw
    assert read_all(framing, raw, c.TO_BOARD) == [Received(frame, raw)]


def test_the_golden_bytes_name_their_source() -> None:
    assert "public ROS 1 driver" in GOLDEN["source"]
    assert len(BY_NAME) == 11


@pytest.mark.parametrize("on", [True, False])
def test_a_switch_is_one_byte(on: bool) -> None:
    assert c.UltrasonicBrakeSet(on).to_bytes() == bytes([on])


def test_a_stop_has_no_velocity_unless_told() -> None:
    assert c.MotionCommand(c.MotionKind.STOP).to_bytes() == bytes(5)


@pytest.mark.parametrize(("linear", "angular"), [(32768, 0), (0, -32768)])
def test_motion_beyond_15_bits_cannot_be_made(linear: int, angular: int) -> None:
    with pytest.raises(WireError, match="velocity"):
        c.MotionCommand(c.MotionKind.RUN, linear, angular)


@pytest.mark.parametrize("kind", [3, 0x80, 255])
def test_another_motion_command_is_refused(kind: int) -> None:
    with pytest.raises(WireError) as refused:
        made(c.MotionCommand, bytes([kind, 0, 0, 0, 0]))
    assert str(refused.value) == f"motion command is {kind}, allowed is 0 STOP, 1 RUN, 2 BREAK"


@pytest.mark.parametrize("value", [2, 0x80, 255])
def test_a_switch_that_is_neither_on_nor_off_is_refused(value: int) -> None:
    with pytest.raises(WireError, match="0 or 1"):
        made(c.BumperBrakeSet, bytes([value]))


@pytest.mark.parametrize("field", range(9))
@pytest.mark.parametrize("value", [-1, 256])
def test_a_lamp_field_beyond_a_byte_cannot_be_made(field: int, value: int) -> None:
    values = [value if i == field else 0 for i in range(9)]
    with pytest.raises(WireError) as refused:
        c.LedSet(*values)
    assert (
        str(refused.value) == f"{c.LedSet.__struct_fields__[field]} is {value}, allowed is 0..255"
    )


def test_lightness_ends_at_ten() -> None:
    assert c.LedSet(0, 0, 10, 0, 0, 0, 0, 0, 0).to_bytes()[2] == 10
    with pytest.raises(WireError, match=r"on_lightness is 11, allowed is 0\.\.10"):
        c.LedSet(0, 0, 11, 0, 0, 0, 0, 0, 0)


def test_minus_zero_from_the_wire_is_zero() -> None:
    read = made(c.MotionCommand, bytes.fromhex("0100800080"))
    assert read == c.MotionCommand(c.MotionKind.RUN, 0, 0)
    assert read.to_bytes() == bytes.fromhex("0100000000")
