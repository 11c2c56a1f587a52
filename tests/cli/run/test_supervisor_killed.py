"""A killed ``t2 up`` at speed: the frames that the board receives afterwards."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from cli.demo import host_stalls
from common import clock
from tests.cli.processes import children, sets, t2
from verification.faults.independent_client import DRIVE
from verification.harness.ports import free_port
from verification.harness.trace import TraceFollower, last_move_s, moves

SPEED = 0.4
BUDGET_S = 0.1
QUIET_S = 1.5
UP_S = 60.0


@contextlib.contextmanager
def driven(folder: Path) -> Iterator[tuple[int, TraceFollower]]:
    """Drive a stack of ``t2 up`` on a separate board; yield the supervisor's pid and the frames."""
    board, first, second = (free_port(socket.SOCK_DGRAM) for _ in range(3))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    words = sets(
        f"board.port={board}", f"board.listen_ports={first},{second}", f"bus.listen={endpoint}",
        "board.address=127.0.0.1", "board.listen_address=127.0.0.1",
        f"recorder.folder={folder}", *host_stalls.settings(host_stalls.measured()),
    )  # fmt: skip
    trace = folder / "trace.jsonl"
    with contextlib.ExitStack() as ended:
        log = ended.enter_context((folder / "log").open("wb"))

        def start(command: Sequence[str], stdin: int | None = None) -> "subprocess.Popen[bytes]":
            made = subprocess.Popen(
                command, stdin=stdin, stdout=log, stderr=log, start_new_session=True
            )
            ended.callback(made.communicate)  # closes its pipe, too
            ended.callback(made.kill)
            return made

        start([sys.executable, "-m", "sim", "--world", "empty", "--trace", str(trace), *words])
        up = start(t2("up", "--no-sim", *words))
        driver = start(
            [sys.executable, "-m", "verification.faults.independent_client", endpoint, DRIVE],
            stdin=subprocess.PIPE,
        )
        frames = TraceFollower(trace)
        assert driver.stdin is not None

        def moving() -> bool:
            frames.follow()
            return bool(frames.commands) and moves(frames.commands[-1])

        end_s = time.monotonic() + UP_S
        while not moving():
            assert time.monotonic() < end_s, (folder / "log").read_text()
            for speed in (0.0, SPEED):
                driver.stdin.write(b"%f\n" % speed)
                driver.stdin.flush()
                time.sleep(1.0)
        left = children(up.pid)
        try:
            yield up.pid, frames
        finally:
            for pid in left.values():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)


def kill_session(leader: int) -> None:
    """Kill every process of a session, with SIGKILL, as a forced logout does."""
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if os.getsid(int(path.name)) == leader:
                os.kill(int(path.name), signal.SIGKILL)


WAYS: dict[str, Callable[[int], None]] = {
    "the supervisor": lambda pid: os.kill(pid, signal.SIGKILL),
    "its session": kill_session,
}


@pytest.mark.timed
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends children with their parent")
@pytest.mark.parametrize("way", WAYS)
def test_no_run_after_a_kill_of(way: str, tmp_path: Path) -> None:
    with driven(tmp_path) as (pid, frames):
        frames.forget()
        at_ns = clock.now_ns()
        WAYS[way](pid)
        time.sleep(QUIET_S)
        assert frames.follow().commands, "no frame came after it"
        assert last_move_s(frames.commands, at_ns) < BUDGET_S
        assert frames.commands[-1].kind != "run"
