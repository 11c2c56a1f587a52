"""Going ahead of ordinary processes: in processes of their own, since there is no way back."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from common.realtime import SAFETY
from tests.common.rights import PATIENCE_S, PRELUDE, needs_right, output_of


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
    assert output_of(f"{drop}r.request(1); r.limit(); print(r.priority())") == ["0"]


@needs_right
def test_all_threads_of_a_service_have_one_priority(shared_router: str) -> None:
    """Otherwise an ordinary thread that holds Python's lock and does not run delays the others."""
    sets = "--set", f"bus.connect={shared_router}", "--set", "host.realtime=true"
    command = [sys.executable, "-m", "services.safety", *sets]
    environ = {name: value for name, value in os.environ.items() if name != "T2__HOST__REALTIME"}
    with subprocess.Popen(command, env=environ, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        try:
            assert b"started" in process.stderr.readline()
            time.sleep(1.0)  # until the sessions are open, and Zenoh's threads with them
            tasks = [int(task.name) for task in Path(f"/proc/{process.pid}/task").iterdir()]
            found = [(os.sched_getscheduler(t), os.sched_getparam(t).sched_priority) for t in tasks]
        finally:
            process.kill()
    assert len(found) > 10  # the loop, the log, Zenoh's runtime, one for each subscription
    flags = os.SCHED_RESET_ON_FORK
    assert {(policy & ~flags, priority) for policy, priority in found} == {(os.SCHED_FIFO, SAFETY)}
