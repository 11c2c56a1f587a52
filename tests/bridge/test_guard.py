"""The guard: the board receives BRAKE whenever the program that it watches fails."""

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
from pathlib import Path
from typing import Any

import pytest

from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.config import Sources, load
from common.settings import Board as BoardSettings
from common.wire.commands import MotionKind
from services.bridge import __main__ as program
from services.bridge import guard as guard_module
from services.bridge.config import BridgeConfig
from services.bridge.guard import Guard, Pulse, Start
from services.bridge.udp import Sockets
from t2.errors import LinkError
from tests.common.rights import needs_right
from tests.common.systemd_manager import PATIENCE_US, Manager
from verification.harness.fake_board import Board, board
from verification.harness.waiting import wait_until

# In the bridge's place: each pulse names the second port.
CHILD = f"""
import os, signal, sys, time
from pathlib import Path
*_, pipe = map(int, os.environ["T2_BRIDGE_DESCRIPTORS"].split(","))
def beat():
    os.write(pipe, bytes((1,)))
def end():
    sys.exit({EXIT_LINK})  # the guard does not restart it
lives = Path("lives")
lives.write_text(lives.read_text() + "x" if lives.exists() else "x")
first = lives.read_text() == "x"
"""


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Board]:
    monkeypatch.chdir(tmp_path)
    with board() as it:
        yield it


def guard_of(made: Board, code: str) -> Guard:
    """Return a guard over a program of ours."""
    sets = [f"board.port={made.address[1]}", f"board.listen_ports={made.ports}"]
    config = load(BridgeConfig, Sources(environ={}, sets=sets)).config
    return Guard(config, Sockets(config.board), [sys.executable, "-S", "-c", CHILD + code])


def run(guard: Guard) -> int:
    try:
        return guard.run()
    finally:
        guard._sockets.close()


def lives() -> int:
    """Return how often the child was started."""
    return len(Path("lives").read_text())


@pytest.mark.parametrize(
    ("code", "brakes"),  # one at each start and each end, five before it is killed
    [
        ("beat(); first and os.kill(os.getpid(), signal.SIGKILL); end()", 4),
        ("beat(); first and time.sleep(1000); end()", 4 + 5),
        ("beat(); first and os.kill(os.getpid(), signal.SIGSTOP); end()", 4 + 5),
    ],
    ids=["dies", "hangs", "is stopped"],
)
def test_a_bridge_that_fails_is_braked_for_and_started_again(
    made: Board, code: str, brakes: int
) -> None:
    assert run(guard_of(made, code)) == EXIT_LINK
    assert lives() == 2
    wait_until(lambda: len(made.motions) >= brakes, "BRAKE")
    assert {motion.kind for motion in made.motions} == {MotionKind.BREAK}
    assert made.sources[-1][1] == made.ports[1], "the port that the bridge used"


def test_a_bridge_that_was_only_held_up_lives_on(
    made: Board, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guard_module, "HANG_BRAKES_MAX", 1000)
    assert run(guard_of(made, "beat(); time.sleep(0.5); beat(); end()")) == EXIT_LINK
    assert lives() == 1
    wait_until(lambda: len(made.motions) > 4, "BRAKE meanwhile")


def test_a_bridge_that_sleeps_in_its_start_is_killed(
    made: Board, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guard_module, "START_S", 0.3)
    assert run(guard_of(made, "first and time.sleep(1000); beat(); end()")) == EXIT_LINK
    assert lives() == 2


def test_a_bridge_that_waits_for_the_cpu_in_its_start_lives_on(
    made: Board, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here a sleep counts as such a wait: it would be killed after six BRAKEs otherwise."""
    monkeypatch.setattr(guard_module, "START_S", 0.3)
    monkeypatch.setattr(Start, "WAITS", b"RDS")
    monkeypatch.setattr(Start, "TICK_S", 0.0)  # of the interpreter's start
    assert run(guard_of(made, "time.sleep(2); beat(); end()")) == EXIT_LINK
    assert lives() == 1
    wait_until(lambda: len(made.motions) > 20, "BRAKE meanwhile")


@pytest.mark.parametrize(
    ("state", "ticks", "used_s"),
    [
        ("R", [0, 0], 0.0),  # starved
        ("D", [0, 0], 0.0),  # reads the disk
        ("S", [0, 0], 2.0),
        ("T", [0, 0], 2.0),
        ("R", [100, 300], 3.0),  # runs away
        ("S", [30, 30], 1.3),
        ("R", [30, 30], 0.3),
    ],
)
def test_the_time_of_a_start_is_its_cpu_time_and_its_sleep(
    state: str, ticks: list[int], used_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Start, "TICK_S", 0.01)
    start, start._stat = Start(0), tmp_path / "stat"
    for count in ticks:
        start._stat.write_text(f"7 (a) S) {state} {'0 ' * 10}{count - 10 if count else 0} "
                               f"{10 if count else 0} {'0 ' * 30}")  # fmt: skip
        start.add(1.0)
    assert start.used_s == pytest.approx(used_s)


def test_the_time_of_a_start_is_all_time_where_the_system_reports_none(tmp_path: Path) -> None:
    start, start._stat = Start(0), tmp_path / "none"
    start.add(1.0)
    assert start.used_s == 1.0


def test_a_permanent_error_is_passed_on_and_braked_for(made: Board) -> None:
    assert run(guard_of(made, f"raise SystemExit({EXIT_CONFIG})")) == EXIT_CONFIG
    wait_until(lambda: len(made.motions) >= 2, "BRAKE before and after it")


@pytest.mark.parametrize("what", ["pipe", "Popen"])
def test_a_bridge_that_cannot_be_started_is_braked_for_and_tried_again(
    made: Board, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    guard = guard_of(made, "end()")
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


# --- under a supervisor -------------------------------------------------------------------------


def test_the_supervisor_learns_that_it_is_ready_that_it_lives_and_that_it_stops(
    made: Board, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The child ignores the signal that is passed on, and is killed."""
    monkeypatch.setattr(guard_module, "HANG_BRAKES_MAX", 100)
    monkeypatch.setattr(guard_module, "STOP_TIMEOUT_S", 0.1)
    monkeypatch.setattr(guard_module, "EXIT_BRAKES_MAX", 3)
    code = """
assert "NOTIFY_SOCKET" not in os.environ, "the bridge does not speak for its guard"
signal.signal(signal.SIGTERM, signal.SIG_IGN)
beat()
time.sleep(0.6)
os.kill(os.getppid(), signal.SIGTERM)
os.close(pipe)
time.sleep(1000)
"""
    with contextlib.closing(Manager(str(tmp_path / "notify"))) as manager:
        monkeypatch.setenv("NOTIFY_SOCKET", manager.environ["NOTIFY_SOCKET"])
        # The queue of a socket holds ten notifications.
        monkeypatch.setenv("WATCHDOG_USEC", str(4 * PATIENCE_US))
        assert run(guard_of(made, code)) == 128 + signal.SIGKILL
        messages = manager.read()
    assert messages.count("READY=1") == messages.count("STOPPING=1") == 1
    assert messages.count("WATCHDOG=1") >= 3, "while it brakes, too"
    assert lives() == 1


SPIN = """
import os
from common import realtime
from services.bridge.guard import DESCRIPTORS_ENV
realtime.request(realtime.BRIDGE)
realtime.limit()
os.write(int(os.environ[DESCRIPTORS_ENV].split(",")[-1]), b"\\0")
while True:
    pass
"""
GUARD = f"""
import os, sys
os.sched_setaffinity(0, {{min(os.sched_getaffinity(0))}})
from common import log, realtime
from common.config import Sources, load
from services.bridge.config import BridgeConfig
from services.bridge.guard import Guard
from services.bridge.udp import Sockets
config = load(BridgeConfig, Sources(environ={{}}, sets=sys.argv[1:])).config
log.configure(config.log, "guard")
realtime.request(realtime.GUARD, alone=True)
sys.exit(Guard(config, Sockets(config.board), [sys.executable, "-c", {SPIN!r}]).run())
"""


@needs_right
@pytest.mark.timed  # it takes a whole core
def test_a_bridge_that_runs_away_on_the_only_core_is_braked_for_and_killed() -> None:
    with board() as made:
        sets = [f"board.port={made.address[1]}", f"board.listen_ports={made.ports}"]
        command = [sys.executable, "-c", GUARD, *sets]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as guard:
            try:
                assert guard.stderr is not None
                said = guard.stderr.readline()
                count = len(made.motions)
                wait_until(lambda: len(made.motions) > count, "BRAKE")
            finally:
                guard.terminate()
    # A guard that had to wait would have found that Linux had ended it, after a second.
    assert "the bridge hangs: killed" in said


# --- the pipe and the ports ---------------------------------------------------------------------


def test_a_beat_names_the_port_waits_for_nobody_and_the_end_is_final() -> None:
    out, into = os.pipe()
    pulse = Pulse(into, pytest.fail)
    for port in (0, 1, 0):
        pulse.beat(port)
    assert os.read(out, 10) == b"\0\1\0"
    for _ in range(100_000):  # more than a pipe takes
        pulse.beat(0)
    pulse.end()
    pulse.end()
    pulse.beat(0)
    while os.read(out, 65536):
        pass
    os.close(out)


def test_a_wrong_setting_ends_it_before_anything_opens(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(["--set", "host.stall=-1"]) == EXIT_CONFIG
    assert "stall" in capsys.readouterr().err


def test_a_port_that_becomes_free_is_taken(made: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = BoardSettings(port=made.address[1], listen_ports=tuple(made.ports))
    taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    taken.bind((settings.listen_address, made.ports[0]))
    leaver = threading.Timer(0.3, taken.close)
    leaver.start()
    program.bound(settings).close()
    leaver.join()
    monkeypatch.setattr(program, "BIND_TIMEOUT_S", 0.0)
    text = f"cannot listen on UDP 127.0.0.1:{made.ports[0]}: another program has it"
    with contextlib.closing(program.bound(settings)), pytest.raises(LinkError, match=text):
        program.bound(settings)
