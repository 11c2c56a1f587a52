"""The soak: one short real one, and every way in which it cannot run."""

import signal
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from common.cli_args import EXIT_CONFIG
from tests.cli.processes import children, running, wait_gone
from verification.harness.waiting import wait_until
from verification.soak.__main__ import main

SOAK_S = 50
PATIENCE_S = 160.0


def soak_command(*words: str) -> list[str]:
    return [sys.executable, "-m", "verification.soak", *words]


@pytest.mark.timed
@pytest.mark.campaign
@pytest.mark.timeout(PATIENCE_S + 20)
def test_a_short_soak(tmp_path: Path) -> None:
    """Half a minute is too short to measure growth, so only that result may fail."""
    out = tmp_path / "out"
    result = subprocess.run(
        soak_command("--minutes", str(SOAK_S / 60), "--seed", "19", "--out", str(out)),
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    everything = result.stdout + result.stderr
    lines = result.stdout.splitlines()
    wrong = [line for line in lines if "WRONG" in line]
    growth = ("memory", "threads, descriptors")
    assert [line for line in wrong if not any(word in line for word in growth)] == [], everything
    assert "no run was long enough" not in everything
    assert result.returncode == (1 if wrong else 0), everything
    assert "Traceback" not in everything
    assert "kill " in result.stdout
    assert "wire " in result.stdout
    for name in ("router", "sim", "bridge", "safety", "odom", "driver"):
        assert any(f" {name}: memory" in line for line in lines), everything
    assert {"soak.png", "soak.svg", "samples.json", "processes.log", "trace.jsonl"} == {
        file.name for file in out.iterdir()
    }
    lives = msgspec.json.decode((out / "samples.json").read_bytes())["lives"]
    assert {process["name"] for process, _ in lives} >= {"router", "safety", "driver"}


@pytest.mark.parametrize("minutes", ["0", "-1", "nan", "1e9", "long"])
def test_a_length_that_is_none_is_refused(minutes: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["--minutes", minutes])
    assert end.value.code == 2
    assert minutes in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert main(["--out", str(tmp_path / "file")]) == EXIT_CONFIG
    assert "cannot be written" in capsys.readouterr().err


def test_without_proc_the_error_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("verification.soak.__main__.PROC", tmp_path)
    assert main(["--out", str(tmp_path)]) == 1
    assert "needs /proc" in capsys.readouterr().err


@pytest.mark.campaign
def test_ctrl_c_ends_it_with_what_is_known_and_leaves_nothing(tmp_path: Path) -> None:
    words = soak_command("--minutes", "5", "--out", str(tmp_path / "out"))
    with running(words, tmp_path / "said") as process:
        wait_until(lambda: len(children(process.pid)) == 6, "all processes", PATIENCE_S)
        pids = children(process.pid)
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 128 + signal.SIGINT
        wait_gone(list(pids.values()))
    said = (tmp_path / "said").read_text()
    assert "laps finished" in said
    assert "Traceback" not in said
