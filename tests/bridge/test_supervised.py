"""The guard under a supervisor that watches it, and that speaks to guard and bridge alike."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.wire.commands import MotionKind
from tests.bridge.bridge_fixture import (
    BridgeFixture,
    breaks_since,
    bridge_command,
    bridge_pid,
    bridge_process,
)
from tests.common.systemd_manager import PATIENCE_US, Manager
from verification.harness.fake_board import Board, board
from verification.harness.waiting import wait_until

Watched = tuple[Board, "subprocess.Popen[bytes]", Manager]


@pytest.fixture
def watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watched]:
    """Run guard and bridge without a router, under a supervisor's eyes."""
    with contextlib.closing(Manager(str(tmp_path / "notify"))) as manager, board() as made:
        monkeypatch.setenv("NOTIFY_SOCKET", manager.environ["NOTIFY_SOCKET"])
        monkeypatch.setenv("WATCHDOG_USEC", str(PATIENCE_US))
        with bridge_process(made, "tcp/127.0.0.1:1", "bridge.stall=0.1") as process:
            made.wait_for(MotionKind.STOP)
            yield made, process, manager


def test_the_guard_is_ready_once_the_bridge_lives(watched: Watched) -> None:
    _, process, manager = watched
    wait_until(lambda: "READY=1" in manager.read(), "that it is ready")
    assert manager.messages.count("READY=1") == 1
    environ = Path(f"/proc/{bridge_pid(process)}/environ").read_bytes()
    assert b"NOTIFY_SOCKET" not in environ, "the bridge does not speak for its guard"
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == 0
    assert "STOPPING=1" in manager.read()


def test_the_guard_beats_though_the_bridge_hangs_and_not_when_it_hangs(watched: Watched) -> None:
    made, process, manager = watched
    wait_until(lambda: "READY=1" in manager.read(), "that it is ready")
    first, count = bridge_pid(process), len(made.motions)
    os.kill(first, signal.SIGSTOP)
    wait_until(lambda: breaks_since(made, count), "BRAKE")
    beats = manager.beats()
    wait_until(lambda: manager.beats() > beats, "a beat while it brakes")
    wait_until(lambda: bridge_pid(process) != first, "the next bridge")
    process.send_signal(signal.SIGSTOP)
    beats = manager.beats()
    with pytest.raises(AssertionError):
        wait_until(lambda: manager.beats() > beats + 1, "a beat of a stopped guard", patience_s=0.6)
    process.send_signal(signal.SIGCONT)
    wait_until(lambda: manager.beats() > beats + 1, "beats again")


SUPERVISOR = """
import sys
from cli.run.supervisor import Supervisor
Supervisor([("bridge", sys.argv[1:])]).run()
"""


def test_a_killed_supervisor_leaves_a_vehicle_that_was_braked() -> None:
    with board() as made:
        command = bridge_command(made, "tcp/127.0.0.1:1")
        supervisor = subprocess.Popen([sys.executable, "-c", SUPERVISOR, *command])
        made.wait_for(MotionKind.STOP)
        time.sleep(0.5)  # STOP continues
        count, killed_s = len(made.motions), time.monotonic()
        supervisor.kill()
        supervisor.wait()
        wait_until(lambda: breaks_since(made, count), "BRAKE, not the STOP of a normal end")
        wait_until(lambda: is_quiet(made), "the end of guard and bridge")
        made.wait_for(MotionKind.BREAK)
        assert made.times[-1] - killed_s < 5.0


def is_quiet(made: Board) -> bool:
    """Return whether no frames are sent any more."""
    count = len(made.motions)
    time.sleep(0.3)
    return len(made.motions) == count


def test_a_hang_up_for_both_comes_to_rest_with_stop_and_leaves_no_break(
    bridge: BridgeFixture,
) -> None:
    bridge.drive()
    count = len(bridge.board.motions)
    os.kill(bridge_pid(bridge.process), signal.SIGHUP)
    bridge.process.send_signal(signal.SIGHUP)
    assert bridge.process.wait(20) == 0
    assert breaks_since(bridge.board, count) == 0
    bridge.board.wait_for(MotionKind.STOP)


def test_a_guard_that_is_killed_for_its_hang_leaves_a_bridge_that_stops(
    bridge: BridgeFixture,
) -> None:
    bridge.drive()
    pid = bridge_pid(bridge.process)
    os.kill(pid, signal.SIGQUIT)
    bridge.process.send_signal(signal.SIGQUIT)
    assert bridge.process.wait(20) == -signal.SIGQUIT
    bridge.board.wait_for(MotionKind.STOP)
    wait_until(lambda: not Path(f"/proc/{pid}").exists(), "the end of the bridge")
