"""``t2 wire`` from the command line: output, exit codes, errors."""

import json
from pathlib import Path

import pytest

from cli.__main__ import main
from common.cli_args import EXIT_CONFIG
from common.wire.framing import Framing
from tests.cli.captures import DISTANCE, QUERY, RUN, VELOCITY, as_pcap, on_ethernet, packet
from verification.harness.frame_strategies import COMMANDS


def test_decode_prints_one_line_per_frame(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wire", "decode", (RUN + QUERY).hex()]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "+0    pc    MotionCommand kind RUN, linear 500 mm/s, angular 30.0 deg/s",
        "+13   pc    DistanceQuery",
    ]


def test_decode_shows_the_place_in_a_capture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "trip.pcap"
    file.write_bytes(as_pcap([on_ethernet(packet(VELOCITY + DISTANCE))]))
    assert main(["wire", "decode", "--from", "board", str(file)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("packet 1 10.7.5.224:4002 > 10.7.5.220:4001 +0    board Velocity")
    assert "+12   board DistanceReport distance 1234 mm, heading -90.5 deg" in second


def test_an_invalid_run_gives_exit_code_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wire", "decode", RUN.hex() + "ff"]) == 1
    assert "+13   BAD no_magic" in capsys.readouterr().out


def test_json_lines(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wire", "decode", "--json", (RUN + QUERY).hex()]) == 0
    tables = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [table["frame"] for table in tables] == [["MotionCommand"], ["DistanceQuery"]]
    assert tables[0]["fields"] == {"kind": 1, "linear_mmps": 500, "angular_raw": 300}


def test_wire_settings_apply(capsys: pytest.CaptureFixture[str]) -> None:
    raw = Framing("modbus", "header_and_payload").pack(COMMANDS[0]).hex()
    sets = ["--set", "wire.crc=modbus", "--set", "wire.crc_covers=header_and_payload"]
    assert main(["wire", "decode", raw]) == 1
    assert main(["wire", "decode", raw, *sets]) == 0
    assert main(["wire", "decode", raw, "--set", "wire.crc=no-such"]) == EXIT_CONFIG
    assert "wire" in capsys.readouterr().err


def test_an_unreadable_source_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wire", "decode", "no/such.pcap"]) == 1
    assert "t2 wire: 'no/such.pcap' is neither hex nor a file" in capsys.readouterr().err


def test_identify_crc(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "frames.txt"
    file.write_text("\n".join(Framing().pack(frame).hex() for frame in COMMANDS), encoding="utf-8")
    assert main(["wire", "identify-crc", str(file)]) == 0
    out = capsys.readouterr().out
    assert "8 frames; 3 have an empty or all-zero payload" in out
    assert 'set: wire.crc = "crc-16", wire.crc_covers = "payload"' in out


def test_identify_crc_without_evidence_gives_exit_code_1(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["wire", "identify-crc", QUERY.hex()]) == 1
    assert "inconclusive" in capsys.readouterr().out


def test_identify_crc_without_frames(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wire", "identify-crc", "0102"]) == 1
    assert "the magic 47 53 is missing" in capsys.readouterr().err
