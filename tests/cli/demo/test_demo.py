"""``t2 demo``: one real lap, Ctrl-C in a terminal, and failures at the start."""

import contextlib
import fcntl
import os
import signal
import socket
import struct
import subprocess
import termios
from argparse import Namespace
from pathlib import Path

import pytest

from cli.__main__ import main
from cli.demo import command, host_stalls
from cli.demo.score import read
from cli.settings import Everything
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.config import Sources, load
from tests.cli.processes import PATIENCE_S, children, ran, sets, t2, wait_gone
from verification.harness.waiting import wait_until

LAP_S = 200.0  # with scheduling stalls; without them a quarter of it


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the measurement of stalls."""
    monkeypatch.setattr(host_stalls, "measured", lambda: 0.0)


# --- one real lap -----------------------------------------------------------------------------


@pytest.mark.timed
@pytest.mark.campaign
@pytest.mark.timeout(LAP_S + 40)
def test_a_lap(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    result = subprocess.run(
        t2("demo", "--fast", "--out", str(out)),
        capture_output=True, text=True, timeout=LAP_S, check=False,
    )  # fmt: skip
    everything = result.stdout + result.stderr
    assert result.returncode == 0, everything
    steps = ["wait for safety", "drive off to the wall", "turn left", "reset, refused", "release"]
    assert [line for line in result.stdout.splitlines() if line.strip() in steps] == [
        f"  {step}" for step in steps
    ]
    assert "reset, refused: refused: " in result.stdout
    assert "9 steps" in result.stdout
    assert "contact 1" in result.stdout
    assert "WRONG" not in result.stdout
    assert "Traceback" not in everything
    assert {file.name for file in out.iterdir()} == {"processes.log", "trace.jsonl"}
    trace = read(out / "trace.jsonl")
    assert any(hit.pressed for hit in trace.bumper)
    assert {command.kind for command in trace.commands} == {"stop", "run", "brake"}
    assert '"event": "stopped"' in (out / "processes.log").read_text()


# --- ctrl-c -----------------------------------------------------------------------------------


def test_ctrl_c_ends_it_and_restores_the_terminal(tmp_path: Path) -> None:
    outer, inner = os.openpty()
    fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
    before = termios.tcgetattr(inner)
    os.set_blocking(outer, False)
    process = subprocess.Popen(
        t2("demo", "--out", str(tmp_path)),
        stdin=inner, stdout=inner, stderr=inner,
        env=os.environ | {"TERM": "xterm-256color"},
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )  # fmt: skip
    shown = bytearray()

    def shows(words: str) -> bool:
        with contextlib.suppress(BlockingIOError):
            shown.extend(os.read(outer, 65536))
        return words.encode() in shown

    try:
        wait_until(
            lambda: shows("T2 drives a lap") and shows("✓ wait"), "the live display", PATIENCE_S
        )
        pids = children(process.pid)
        assert set(pids) == {"router", "sim", "bridge", "safety", "odom"}
        os.write(outer, b"\x03")
        wait_until(lambda: shows("") and process.poll() is not None, "the end", PATIENCE_S)
        shows("")
        assert process.returncode == 128 + signal.SIGINT
        wait_gone(list(pids.values()))
        assert b"Traceback" not in shown
        assert shown.rindex(b"\x1b[?25h") > shown.rindex(b"\x1b[?25l"), "the cursor stays hidden"
        assert termios.tcgetattr(inner) == before
    finally:
        process.kill()
        process.wait()
        os.close(outer)
        os.close(inner)
    assert not (tmp_path / "lap.png").exists()


def test_ctrl_c_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> float:
        raise KeyboardInterrupt

    monkeypatch.setattr(host_stalls, "measured", interrupted)
    assert main(["demo", "--out", str(tmp_path)]) == 130
    assert capsys.readouterr().err == ""


# --- failures --------------------------------------------------------------------------


def test_a_process_that_cannot_run_ends_it_and_names_the_log(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        result = ran("demo", "--out", str(tmp_path), *sets(f"board.port={port}"))
    assert result.returncode == EXIT_LINK
    log = tmp_path / "processes.log"
    assert f"t2 demo: a process cannot run; see {log}" in result.stderr
    assert "Traceback" not in result.stderr
    assert f"cannot listen on UDP port {port}" in log.read_text()


@pytest.mark.usefixtures("quick")
def test_a_bad_setting_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--out", str(tmp_path), "--set", "sim.seed=-1"]) == EXIT_CONFIG
    assert capsys.readouterr().err.startswith("t2 demo: --set sim.seed=-1: sim.seed = -1: ")


@pytest.mark.parametrize("where", ["file", "file/out"])
def test_a_folder_that_cannot_be_written_is_named(
    where: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    assert main(["demo", "--out", str(tmp_path / where)]) == EXIT_CONFIG
    error = capsys.readouterr().err
    assert error.startswith(f"t2 demo: --out {tmp_path / where}: cannot be written: ")
    assert len(error.splitlines()) == 1


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("number", "code"), [(0, EXIT_LINK), (signal.SIGINT, 130), (signal.SIGTERM, 143)]
)
def test_an_earlier_trace_is_deleted(
    number: int, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "trace.jsonl").write_text("an earlier lap\n")
    monkeypatch.setattr(command, "drive", lambda *_: number)
    assert main(["demo", "--out", str(tmp_path)]) == code
    assert not (tmp_path / "trace.jsonl").exists()


# --- the parts --------------------------------------------------------------------------------


def test_separate_ports_override_the_files() -> None:
    vehicle = Path("config/vehicle.toml")
    config = load(
        Everything, Sources(files=(vehicle,), environ={}, sets=command.own_ports())
    ).config
    assert config.board.address == config.board.listen_address == "127.0.0.1"
    assert len({config.board.port, *config.board.listen_ports}) == 3
    assert config.bus.endpoints == config.bus.listen


def test_only_the_simulator_writes_a_trace() -> None:
    options = Namespace(no_sim=False, world="office", config=None, sets=[], out=Path("there"))
    for name, words in command.traced(options):
        assert (words[-2:] == ["--trace", "there/trace.jsonl"]) is (name == "sim")
