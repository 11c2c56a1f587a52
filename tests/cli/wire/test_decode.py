"""Frames as text: senders, fields with units, reasons of invalid runs."""

import json

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cli.wire.command import Bad, Good, as_json, as_text, parts
from common.settings import Wire
from common.wire import commands as c
from common.wire import reports as r
from common.wire.frame import Frame, Side
from common.wire.framing import Framing
from verification.harness.frame_strategies import COMMANDS, REPORTS

framing = Framing()


def lines(raw: bytes, sender: str = "both", wire: Wire | None = None) -> list[str]:
    return [as_text(part, wire or Wire()) for part in parts(framing, raw, sender)]


TEXTS = [
    (c.MotionCommand(c.MotionKind.RUN, 500, -300),
     "pc    MotionCommand kind RUN, linear 500 mm/s, angular -30.0 deg/s"),
    (c.DistanceQuery(), "pc    DistanceQuery"),
    (c.DriverQuery(Side.RIGHT), "pc    DriverQuery side RIGHT"),
    (c.LedSet(9, 1, 8, 2, 3, 4, 5, 6, 7),
     "pc    LedSet channel 9, mode 1, on_lightness 8, on_time 2, off_time 3, flash_lightness 4, "
     "speed 5, lightness_min 6, lightness_max 7"),
    (r.VelocityReport(-250, -15), "board VelocityReport linear -250 mm/s, angular -1.5 deg/s"),
    (r.DistanceReport(1234, -905), "board DistanceReport distance 1234 mm, heading -90.5 deg"),
    (r.UltrasonicReport((1, 2, 3, 4, 5, 6, 0xFFFF, 8)),
     "board UltrasonicReport left=1 front_left=2 front=3 front_right=4 right=5 rear_right=6 "
     "rear=fault rear_left=8 mm"),
    (r.BumperReport(True), "board BumperReport on yes"),
    (r.BumperBrakeReport(False),
     "pc or board BumperBrakeSet or BumperBrakeReport on no"),
    (r.DriverReport(Side.LEFT, 0), "board DriverReport side LEFT, faults 0x00000000"),
    (r.DriverReport(Side.LEFT, 0x80000011),
     "board DriverReport side LEFT, faults 0x80000011 over_current overload bit_31"),
    (r.LedReport(False), "board LedReport done no"),
]  # fmt: skip


@pytest.mark.parametrize(("frame", "text"), TEXTS)
def test_a_frame_as_text(frame: Frame, text: str) -> None:
    assert lines(framing.pack(frame)) == [f"+0    {text}"]


def test_the_other_angular_unit() -> None:
    frames: tuple[Frame, ...] = (
        r.VelocityReport(0, 1500),
        c.MotionCommand(c.MotionKind.RUN, 0, 1500),
    )
    for number, setting in enumerate(("feedback_angular_unit", "command_angular_unit")):
        wire = msgspec.convert({setting: "milliradian"}, Wire)
        texts = [lines(framing.pack(frame), wire=wire)[0] for frame in frames]
        assert texts[number].endswith("angular 1.500 rad/s")
        assert texts[1 - number].endswith("angular 150.0 deg/s")


@pytest.mark.parametrize(
    ("sender", "name"), [("pc", "BumperBrakeSet"), ("board", "BumperBrakeReport")]
)
def test_a_known_sender(sender: str, name: str) -> None:
    (line,) = lines(framing.pack(c.BumperBrakeSet(True)), sender)
    assert line == f"+0    {sender:<5} {name} on yes"


@pytest.mark.parametrize("sender", ["pc", "board"])
def test_the_other_senders_frames_are_bad(sender: str) -> None:
    other = REPORTS[0] if sender == "pc" else COMMANDS[0]
    (part,) = parts(framing, framing.pack(other), sender)
    assert isinstance(part, Bad)


def test_frames_and_garbage_with_their_offsets() -> None:
    raw = framing.pack(c.DistanceQuery()) + b"\x01\x02" + framing.pack(r.BumperReport(False))
    assert lines(raw) == [
        "+0    pc    DistanceQuery",
        "+8    BAD no_magic: does not start with 47 53: 0102",
        "+10   board BumperReport on no",
    ]


def test_the_reason_of_the_latest_check() -> None:
    raw = bytearray(framing.pack(r.DistanceReport(5, 5)))
    raw[-1] ^= 1
    (part,) = parts(framing, bytes(raw), "both")
    assert isinstance(part, Bad)
    assert part.reason == "bad_crc"  # and not the wrong size of a query


def test_json() -> None:
    good, bad = parts(framing, framing.pack(r.BumperBrakeReport(True)) + b"\xff", "both")
    assert json.loads(json.dumps(as_json(good, "line 1"))) == {
        "where": "line 1",
        "offset": 0,
        "hex": "475309000476c1c001",
        "from": ["pc", "board"],
        "frame": ["BumperBrakeSet", "BumperBrakeReport"],
        "fields": {"on": True},
    }
    assert json.loads(json.dumps(as_json(bad, "line 1"))) == {
        "where": "line 1",
        "offset": 9,
        "hex": "ff",
        "reason": "no_magic",
        "detail": "does not start with 47 53",
    }


@given(st.lists(st.sampled_from([*COMMANDS, *REPORTS]).map(framing.pack) | st.binary(max_size=9)))
def test_every_byte_is_in_a_part(pieces: list[bytes]) -> None:
    raw = b"".join(pieces)
    found = list(parts(framing, raw, "both"))
    assert b"".join(part.raw for part in found) == raw
    assert [part.offset for part in found] == [
        sum(len(before.raw) for before in found[:i]) for i in range(len(found))
    ]
    for part in found:
        assert as_text(part, Wire())
        assert json.dumps(as_json(part, ""))


@pytest.mark.parametrize("frame", [*COMMANDS, *REPORTS])
def test_every_frame_is_known(frame: Frame) -> None:
    (part,) = parts(framing, framing.pack(frame), "both")
    assert isinstance(part, Good)
    assert frame in part.frames.values()
