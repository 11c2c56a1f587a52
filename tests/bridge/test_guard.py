"""The guard with real processes: the board receives BRAKE whenever the bridge fails."""

import contextlib
import errno
import itertools
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.config import Sources, load
from common.settings import Board as BoardSettings
from common.wire.commands import MotionKind
from services.bridge import __main__ as program
from services.bridge.config import BridgeConfig
from services.bridge.guard import Guard, Heartbeat
from services.bridge.udp import Sockets
from tests.bridge.bridge_fixture import (
    PROC,
    BridgeFixture,
    breaks_since,
    bridge_pid,
    bridge_process,
)
from verification.harness.fake_board import Board, board
from verification.harness.waiting import wait_until


def test_break_goes_first_then_the_bridges_stop() -> None:
    with guarded_rig(0.6) as (made, _):
        kinds = [motion.kind for motion in made.motions]
    first_stop = kinds.index(MotionKind.STOP)
    assert first_stop > 0
    assert set(kinds[:first_stop]) == {MotionKind.BREAK}


def test_a_bridge_that_dies_is_braked_for_and_started_again(bridge: BridgeFixture) -> None:
    bridge.drive()
    source = bridge.board.sources[-1]
    first = bridge_pid(bridge.process)
    count = len(bridge.board.motions)
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: breaks_since(bridge.board, count), "BRAKE")
    wait_until(lambda: bridge_pid(bridge.process) != first, "the next bridge")
    bridge.board.wait_for(MotionKind.STOP)
    bridge.drive()
    assert bridge.board.sources[-1] == source, "from the same port, and the same socket"


def test_a_bridge_that_hangs_is_braked_for_and_killed() -> None:
    with guarded_rig(0.0) as (made, process):
        first = bridge_pid(process)
        count = len(made.motions)
        os.kill(first, signal.SIGSTOP)
        wait_until(lambda: breaks_since(made, count) > 3, "BRAKE, again and again")
        wait_until(lambda: bridge_pid(process) != first, "the next bridge")
        made.wait_for(MotionKind.STOP)


@pytest.mark.timed  # more delay than its own, and the bridge is killed
def test_a_bridge_that_was_only_held_up_lives_on() -> None:
    with guarded_rig(0.0) as (made, process):
        first = bridge_pid(process)
        count = len(made.motions)
        os.kill(first, signal.SIGSTOP)
        wait_until(lambda: breaks_since(made, count), "BRAKE")
        os.kill(first, signal.SIGCONT)
        made.wait_for(MotionKind.STOP)
        wait_until(lambda: {sent.kind for sent in made.motions[-20:]} == {MotionKind.STOP}, "STOPs")
        assert bridge_pid(process) == first


def test_a_bridge_whose_guard_is_killed_stops_the_vehicle_and_ends(bridge: BridgeFixture) -> None:
    bridge.drive()
    first = bridge_pid(bridge.process)
    assert os.getsid(first) == first  # a kill of the guard's session spares the bridge
    bridge.process.kill()
    bridge.board.wait_for(MotionKind.STOP)
    wait_until(lambda: not (PROC / str(first)).exists(), "the end of the bridge")
    assert "guard_gone" in bridge.events()
    count = len(bridge.board.motions)
    with pytest.raises(AssertionError):
        wait_until(
            lambda: len(bridge.board.motions) > count,
            "a frame after both have ended",
            patience_s=0.3,
        )


def test_a_second_bridge_is_refused_with_the_port(bridge: BridgeFixture) -> None:
    bridge.board.wait_for(MotionKind.STOP)  # the first one has the ports
    with bridge_process(bridge.board, bridge.endpoint) as second:
        assert second.stderr is not None
        said = second.stderr.read().decode()
        assert second.wait(20) == EXIT_LINK
    port = bridge.board.ports[0]
    assert f"cannot listen on UDP 127.0.0.1:{port}: another program has it" in said
    assert bridge.process.poll() is None


@contextmanager
def guarded_rig(stall_s: float) -> Iterator[tuple[Board, "subprocess.Popen[bytes]"]]:
    """Run guard and bridge without a router; the bridge sends STOP."""
    with (
        board() as made,
        bridge_process(made, "tcp/127.0.0.1:1", f"bridge.stall={stall_s}") as process,
    ):
        made.wait_for(MotionKind.STOP)
        yield made, process


# --- with a child of our own in the bridge's place ----------------------------------------------


def guard_of(made: Board, code: str) -> Guard:
    """Return a guard over a program of ours."""
    sets = [f"board.port={made.address[1]}", f"board.listen_ports={made.ports}"]
    config = load(BridgeConfig, Sources(environ={}, sets=sets)).config
    return Guard(config, Sockets(config.board), [sys.executable, "-c", code])


@pytest.fixture
def made() -> Iterator[Board]:
    with board() as it:
        yield it


@pytest.fixture(autouse=True)
def _signals() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def run(guard: Guard) -> int:
    try:
        return guard.run()
    finally:
        guard._sockets.close()


def test_a_hopeless_end_is_passed_on_and_braked_for(made: Board) -> None:
    assert run(guard_of(made, f"raise SystemExit({EXIT_CONFIG})")) == EXIT_CONFIG
    made.wait_for(MotionKind.BREAK)


BEAT = """
import os, signal, sys, time
*_, pipe = map(int, os.environ["T2_BRIDGE_DESCRIPTORS"].split(","))
os.write(pipe, bytes((1,)))
"""


def test_a_child_that_outlives_its_last_word_is_killed(made: Board) -> None:
    code = (
        BEAT
        + """
signal.signal(signal.SIGTERM, signal.SIG_IGN)
os.kill(os.getppid(), signal.SIGTERM)
os.close(pipe)
time.sleep(1000)
"""
    )
    guard = guard_of(made, code)
    assert run(guard) == 128 + signal.SIGKILL
    made.wait_for(MotionKind.BREAK)


def test_breaks_leave_from_the_port_that_the_bridge_used(made: Board) -> None:
    assert run(guard_of(made, BEAT + f"sys.exit({EXIT_LINK})")) == EXIT_LINK
    wait_until(lambda: made.sources[-1][1] == made.ports[1], "BRAKE from the second port")


@pytest.mark.parametrize("what", ["pipe", "Popen"])
def test_a_bridge_that_cannot_be_started_is_braked_for_and_tried_again(
    made: Board, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    guard = guard_of(made, f"raise SystemExit({EXIT_LINK})")
    tries: list[float] = []
    owner: Any = os if what == "pipe" else subprocess
    real = getattr(owner, what)

    def fail_first(*given: Any, **more: Any) -> Any:
        tries.append(time.monotonic())
        if len(tries) < 4:
            raise OSError(errno.ENOMEM, "Cannot allocate memory")
        return real(*given, **more)

    monkeypatch.setattr(owner, what, fail_first)
    descriptors = len(list(Path("/proc/self/fd").iterdir()))
    assert run(guard) == EXIT_LINK
    assert len(list(Path("/proc/self/fd").iterdir())) == descriptors - 2, "less the sockets"
    assert tries[3] - tries[0] > 1.4
    breaks = [at for at in made.times if tries[0] < at < tries[3]]
    assert len(breaks) > 20
    assert max(b - a for a, b in itertools.pairwise(breaks)) < 0.3


# --- the pipe -------------------------------------------------------------------------------------


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    out, into = os.pipe()
    yield out, into
    for descriptor in (out, into):
        with contextlib.suppress(OSError):
            os.close(descriptor)


def test_a_beat_names_the_port_and_the_end_is_final(pipe: tuple[int, int]) -> None:
    heartbeat = Heartbeat(pipe[1], pytest.fail)
    for port in (0, 1, 0):
        heartbeat.beat(port)
    assert os.read(pipe[0], 10) == b"\0\1\0"
    heartbeat.end()
    heartbeat.end()
    heartbeat.beat(0)
    assert os.read(pipe[0], 10) == b""


def test_a_guard_that_does_not_read_delays_no_beat(pipe: tuple[int, int]) -> None:
    heartbeat = Heartbeat(pipe[1], pytest.fail)
    for _ in range(100_000):
        heartbeat.beat(0)


# --- the program --------------------------------------------------------------------------------


def test_a_wrong_setting_ends_it_before_anything_opens(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(["--set", "bridge.stall=0.1"]) == EXIT_CONFIG
    assert "stall" in capsys.readouterr().err
    assert program.main(["--set", "bridge.stall=-1"]) == EXIT_CONFIG


def test_a_port_that_becomes_free_is_taken(made: Board) -> None:
    settings = BoardSettings(port=made.address[1], listen_ports=tuple(made.ports))
    taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    taken.bind((settings.listen_address, made.ports[0]))
    leaver = threading.Timer(0.3, taken.close)
    leaver.start()
    program.bound(settings).close()
    leaver.join()
