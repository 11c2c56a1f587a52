"""``t2 demo``: one real lap, and failures at the start."""

import socket
import subprocess
from pathlib import Path

import pytest

from cli.__main__ import main
from cli.demo import host_stalls
from cli.demo.score import read
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from tests.cli.processes import sets, t2

LAP_S = 200.0  # with scheduling stalls; without them a quarter of it


@pytest.mark.timed
@pytest.mark.campaign
@pytest.mark.timeout(LAP_S + 40)
def test_a_lap(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    result = subprocess.run(
        t2("demo", "--out", str(out)),
        capture_output=True, text=True, timeout=LAP_S, check=False,
    )  # fmt: skip
    everything = result.stdout + result.stderr
    assert result.returncode == 0, everything
    lines = result.stdout.splitlines()
    refused = lines.index("  reset, refused") + 1
    assert lines[refused].startswith("    refused: ")
    for words in ("contact 1: frame to BRAKE frame", f"plot: {out}/lap.png"):
        assert words in result.stdout, words
    assert "WRONG" not in result.stdout
    assert "Traceback" not in everything
    assert {file.name for file in out.iterdir()} == {
        "processes.log", "trace.jsonl", "lap.png",
    }  # fmt: skip
    trace = read(out / "trace.jsonl")
    assert any(hit.pressed for hit in trace.bumper)
    assert {command.kind for command in trace.commands} == {"stop", "run", "brake"}
    assert '"event": "stopped"' in (out / "processes.log").read_text()


# --- failures --------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def _calm_host(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host_stalls, "measured", lambda: 0.0)


def test_a_process_that_cannot_run_ends_it_and_names_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "trace.jsonl").write_text("an earlier lap\n")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        assert main(["demo", "--out", str(tmp_path), *sets(f"board.port={port}")]) == EXIT_LINK
    log = tmp_path / "processes.log"
    assert f"t2 demo: a process cannot run; see {log}" in capsys.readouterr().err
    assert f"cannot listen on UDP port {port}" in log.read_text()
    assert (tmp_path / "trace.jsonl").read_text() == ""


def test_a_folder_that_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    assert main(["demo", "--out", f"{tmp_path}/file"]) == EXIT_CONFIG
    assert f"t2 demo: --out {tmp_path}/file: cannot be written: " in capsys.readouterr().err
