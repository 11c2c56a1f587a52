"""Going ahead of ordinary processes: in processes of their own, since there is no way back."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from common.realtime import SAFETY
from tests.common.rights import PATIENCE_S, PRELUDE, needs_right, output_of
from verification.harness.bus import set_options
from verification.harness.ports import udp_ports
from verification.harness.process_stats import children


@needs_right
def test_what_is_started_alone_begins_as_ordinary() -> None:
    child = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"
    look = "from common import realtime as r; print(r.priority())"
    script = f"r.request(54, alone=True); print(r.priority(), flush=True); {child}"
    command = [sys.executable, "-c", PRELUDE + script, look]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    assert done.stdout.split() == ["54", "0"]


@needs_right
def test_one_that_runs_away_is_ended() -> None:
    script = f"{PRELUDE}r.CPU_LIMIT_US = 200_000; r.request(1); r.limit()\nwhile True: pass"
    ran = subprocess.run([sys.executable, "-c", script], timeout=PATIENCE_S, check=False)
    assert ran.returncode == -signal.SIGXCPU


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root, to become somebody without rights")
def test_without_the_right_all_stays_as_it_was() -> None:
    drop = "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)); os.setuid(65534); "
    calls = "r.request(1); r.limit(); r.share_cpu(); r.give_way(); "
    look = "print(r.priority(), len(os.sched_getaffinity(0)))"
    assert output_of(drop + calls + look) == ["0", str(len(os.sched_getaffinity(0)))]


NEIGHBOUR = """
there, back = os.pipe(), os.pipe()
os.set_blocking(back[0], False)
r.request(r.SAFETY)
r.share_cpu()
if os.fork() == 0:
    os.write(back[1], os.read(there[0], 1))
    os._exit(0)
time.sleep(0.2)  # now the child reads

def ran():
    try:
        return bool(os.read(back[0], 1))
    except BlockingIOError:
        return False

os.write(there[1], b"x")
before = ran()
r.give_way()
print(before, ran())
"""


@needs_right
def test_another_one_of_this_priority_runs_when_it_is_given_way() -> None:
    assert output_of("import time\n" + NEIGHBOUR) == ["False", "True"]


@contextmanager
def started(service: str, *sets: str) -> Iterator[int]:
    """Run a service that asks for SCHED_FIFO; return its process once the loop runs."""
    command = [sys.executable, "-m", service, *set_options("host.realtime=true", *sets)]
    environ = {name: value for name, value in os.environ.items() if name != "T2__HOST__REALTIME"}
    with subprocess.Popen(command, env=environ, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        try:
            assert b"started" in process.stderr.readline()
            yield process.pid
        finally:
            process.kill()


@needs_right
def test_all_threads_of_a_service_have_one_priority_and_one_cpu(shared_router: str) -> None:
    """Otherwise an ordinary thread that holds Python's lock and does not run delays the others."""
    with started("services.safety", f"bus.connect={shared_router}") as pid:
        time.sleep(1.0)  # until the sessions are open, and Zenoh's threads with them
        tasks = [int(task.name) for task in Path(f"/proc/{pid}/task").iterdir()]
        found = [(os.sched_getscheduler(t), os.sched_getparam(t).sched_priority) for t in tasks]
        cpus = [os.sched_getaffinity(task) for task in tasks]
    assert len(found) > 10  # the loop, the log, Zenoh's runtime, one for each subscription
    assert all(each == {max(os.sched_getaffinity(0))} for each in cpus)
    flags = os.SCHED_RESET_ON_FORK
    assert {(policy & ~flags, priority) for policy, priority in found} == {(os.SCHED_FIFO, SAFETY)}


@needs_right
def test_the_guard_is_not_bound_to_the_cpu_of_its_bridge(shared_router: str) -> None:
    ports = udp_ports(3)
    sets = f"board.port={ports[0]}", f"board.listen_ports={ports[1:]}"
    with started("services.bridge", f"bus.connect={shared_router}", *sets) as guard:
        (bridge,) = children(guard)
        assert os.sched_getaffinity(guard) == os.sched_getaffinity(0)
        assert os.sched_getaffinity(bridge) == {max(os.sched_getaffinity(0))}
