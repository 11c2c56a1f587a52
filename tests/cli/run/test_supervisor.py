"""Supervisor: restarts with a simulated clock, and the stop of real processes."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import pytest

from cli.run import supervisor as module
from cli.run.supervisor import WATCHDOG_S, Child, Supervisor
from common.child_process import BACKOFF_S
from common.cli_args import EXIT_CONFIG
from tests.cli.processes import alive, running, wait_gone
from verification.harness.waiting import wait_until

SLEEP = ["sleep", "1000"]


Supervise = Callable[..., Supervisor]


@pytest.fixture
def supervise() -> Iterator[Supervise]:
    """Supervises commands by name, and kills their processes at the end."""
    made: list[Supervisor] = []

    def start(**commands: Sequence[str]) -> Supervisor:
        made.append(Supervisor(commands))
        return made[-1]

    yield start
    for supervisor in made:
        for child in supervisor.children:
            if child.process is not None:
                child.process.kill()
                child.process.wait()
        supervisor.end()


def kill(child: Child) -> None:
    """Kill the child's process and reap it."""
    process = child.process
    assert process is not None
    process.kill()
    process.wait()


# --- restarts ---------------------------------------------------------------------------------


def test_restarts_follow_the_backoff(supervise: Supervise) -> None:
    supervisor = supervise(it=SLEEP)
    (child,) = supervisor.children
    now_s = 100.0
    for wait_s in (*BACKOFF_S, BACKOFF_S[-1]):
        assert supervisor.look(now_s) == 0
        kill(child)
        assert supervisor.look(now_s) == 0
        assert child.process is None
        assert child.due_s == now_s + wait_s
        if wait_s:
            assert supervisor.look(now_s + wait_s - 0.01) == 0
            assert child.process is None, f"started again before {wait_s} s were over"
        now_s += wait_s


def test_a_hopeless_process_stops_all_with_its_code(supervise: Supervise) -> None:
    code = EXIT_CONFIG
    supervisor = supervise(calm=SLEEP, hopeless=["sh", "-c", f"exit {code}"])
    assert supervisor.run() == code
    calm, hopeless = (child.process for child in supervisor.children)
    assert calm is not None
    assert calm.returncode == -signal.SIGTERM
    assert hopeless is not None
    assert hopeless.returncode == code


def test_a_safety_that_hangs_is_killed_and_restarted(
    supervise: Supervise, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As systemd does by WatchdogSec; one that has never notified is left alone."""
    monkeypatch.setenv("WATCHDOG_PID", "1")  # of a unit that runs the supervisor
    notify = (
        "import time; from common.systemd import Systemd\n"
        "Systemd().beat(0); time.sleep(1000)"  # none, if it believes to be another process
    )
    supervisor = supervise(safety=[sys.executable, "-c", notify], odom=SLEEP)
    supervisor.look(0.0)
    safety, odom = supervisor.children
    pids = [child.process.pid for child in (safety, odom) if child.process]

    def notified() -> bool:
        supervisor.look(100.0)
        return safety.beat_s == 100.0

    wait_until(notified, "its notification")
    supervisor.look(100.0 + WATCHDOG_S)
    assert [c.process and c.process.pid for c in (safety, odom)] == pids
    supervisor.look(100.1 + WATCHDOG_S)  # killed
    supervisor.look(100.1 + WATCHDOG_S)  # started, at once the first time
    assert safety.process is not None
    assert (safety.process.pid != pids[0], safety.beat_s) == (True, None)
    assert odom.process is not None
    assert odom.process.pid == pids[1]


# --- stop ----------------------------------------------------------------------------------


def reporter(name: str, file: Path, on_term: str = "exit 0") -> list[str]:
    """Return a process that logs its start and its SIGTERM."""
    script = f'trap "echo -{name} >> {file}; {on_term}" TERM; echo +{name} >> {file}; '
    return ["sh", "-c", script + "while :; do sleep 0.05; done"]


def test_processes_stop_in_reverse_order_and_are_killed_at_last(
    tmp_path: Path, supervise: Supervise, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 2.0)
    file = tmp_path / "order"
    deaf = reporter("b", file, on_term=":")
    supervisor = supervise(a=reporter("a", file), b=deaf, c=reporter("c", file))
    supervisor.look(0.0)
    wait_until(lambda: file.exists() and len(file.read_text().split()) == 3, "three starts")
    # Ctrl-C goes to the terminal's process group and must not reach the bridge directly.
    processes = [child.process for child in supervisor.children if child.process]
    assert [os.getpgid(it.pid) for it in processes] == [it.pid for it in processes]
    assert [os.getsid(it.pid) for it in processes] == [it.pid for it in processes]
    supervisor.end()
    assert file.read_text().split()[3:] == ["-c", "-b", "-a"]
    assert [it.returncode for it in processes] == [0, -signal.SIGKILL, 0]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends children with their parent")
def test_a_child_of_a_dead_parent_does_not_run() -> None:
    made = subprocess.Popen(SLEEP, preexec_fn=partial(module._die_with_parent, 1))
    assert made.wait(5.0) == 1


PARENT = """
import time
from cli.run.supervisor import Supervisor
supervisor = Supervisor({"one": ["sleep", "1000"], "two": ["sleep", "1000"]})
supervisor.look(time.monotonic())
print(*(child.process.pid for child in supervisor.children), flush=True)
raise SystemExit(supervisor.run())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends children with their parent")
def test_children_end_with_their_parent(tmp_path: Path) -> None:
    output = tmp_path / "pids"
    with running([sys.executable, "-c", PARENT], output) as parent:
        wait_until(lambda: output.read_text().endswith("\n"), "two children")
        pids = [int(word) for word in output.read_text().split()]
        assert all(map(alive, pids))
        parent.kill()
        wait_gone(pids)
