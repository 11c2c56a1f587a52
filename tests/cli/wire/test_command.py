"""``t2 wire``: output, exit codes and errors; frames as text, with the reasons of invalid runs."""

from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cli.__main__ import main
from cli.wire.command import Bad, as_text, parts
from common.cli_args import EXIT_CONFIG
from common.settings import Wire
from common.wire import commands as c
from common.wire import reports as r
from common.wire.frame import Frame, Side
from common.wire.framing import Framing
from tests.cli.captures import DISTANCE, QUERY, RUN, VELOCITY, as_pcap, on_ethernet, packet
from verification.harness.frame_strategies import COMMANDS, REPORTS

# --- the command line -----------------------------------------------------------------------


def test_decode_prints_one_line_per_frame(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wire", "decode", (RUN + QUERY).hex()]) == 0
    shown = [
        "+0    pc    MotionCommand kind RUN, linear 500 mm/s, angular 30.0 deg/s",
        "+13   pc    DistanceQuery",
    ]
    assert capsys.readouterr().out.splitlines() == shown
    assert main(["wire", "decode", (RUN + QUERY).hex() + "ff"]) == 1
    assert "+21   BAD no_magic" in capsys.readouterr().out


def test_decode_shows_the_place_in_a_capture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "trip.pcap"
    file.write_bytes(as_pcap([on_ethernet(packet(VELOCITY + DISTANCE))]))
    assert main(["wire", "decode", str(file)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("packet 1 10.7.5.224:4002 > 10.7.5.220:4001 +0    board Velocity")
    assert "+12   board DistanceReport distance 1234 mm, heading -90.5 deg" in second


def test_wire_settings_apply(capsys: pytest.CaptureFixture[str]) -> None:
    raw = Framing("modbus", "header_and_payload").pack(COMMANDS[0]).hex()
    sets = ["--set", "wire.crc=modbus", "--set", "wire.crc_covers=header_and_payload"]
    assert main(["wire", "decode", raw]) == 1
    assert main(["wire", "decode", raw, *sets]) == 0
    assert main(["wire", "decode", raw, "--set", "wire.crc=no-such"]) == EXIT_CONFIG
    assert "wire" in capsys.readouterr().err


def test_identify_crc(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "frames.txt"
    file.write_text("\n".join(Framing().pack(frame).hex() for frame in COMMANDS), encoding="utf-8")
    assert main(["wire", "identify-crc", str(file)]) == 0
    out = capsys.readouterr().out
    assert "crc-16 over payload: matches 8 of 8" in out
    assert 'set: wire.crc = "crc-16", wire.crc_covers = "payload"' in out


def test_identify_crc_without_evidence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wire", "identify-crc", QUERY.hex()]) == 1
    assert "nonzero payload, such as motion" in capsys.readouterr().out
    assert main(["wire", "identify-crc", "0102"]) == 1
    assert "the magic 47 53 is missing" in capsys.readouterr().err


# --- frames as text -------------------------------------------------------------------------


framing = Framing()


def lines(raw: bytes, wire: Wire | None = None) -> list[str]:
    return [as_text(part, wire or Wire()) for part in parts(framing, raw)]


TEXTS = [
    (c.MotionCommand(c.MotionKind.RUN, 500, -300),
     "pc    MotionCommand kind RUN, linear 500 mm/s, angular -30.0 deg/s"),
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
    (part,) = parts(framing, bytes(raw))
    assert isinstance(part, Bad)
    assert part.reason == "bad_crc"  # and not the wrong size of a query


@given(st.lists(st.sampled_from([*COMMANDS, *REPORTS]).map(framing.pack) | st.binary(max_size=9)))
def test_every_byte_is_in_a_part(pieces: list[bytes]) -> None:
    raw = b"".join(pieces)
    found = list(parts(framing, raw))
    assert b"".join(part.raw for part in found) == raw
    assert [part.offset for part in found] == [
        sum(len(before.raw) for before in found[:i]) for i in range(len(found))
    ]
    for part in found:
        assert as_text(part, Wire())
