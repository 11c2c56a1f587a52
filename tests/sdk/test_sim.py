"""The processes of ``t2.sim`` end with the process that started it."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

UP_S = 90.0  # on a host under load
PROGRAM = """
import os, time, t2
with t2.sim():
    if not os.fork():
        time.sleep(60)  # a worker that outlives its parent
        os._exit(0)
    print("ready", flush=True)
    time.sleep(600)
"""


def of_group(mark: str) -> set[int]:
    """Return the processes with this variable in their environment."""
    found = set[int]()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (folder / "environ").read_bytes():
                found.add(int(folder.name))
        except OSError:  # it has ended, or is another user's
            pass
    return found


@pytest.mark.parametrize("name", ["SIGTERM", "SIGKILL"])
def test_no_process_outlives_the_one_that_started_it(name: str) -> None:
    mark = f"T2_TEST_MARK={os.getpid()}-{name}"
    variable, _, value = mark.partition("=")
    words = [sys.executable, "-c", PROGRAM]
    environment = {**os.environ, variable: value}
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True) as program:
        try:
            assert program.stdout
            assert program.stdout.readline() == "ready\n"
            assert len(of_group(mark)) > 6
            program.send_signal(getattr(signal, name))
            program.wait(UP_S)
            wait_until(lambda: len(of_group(mark)) == 1, "the end of all but the worker", UP_S)
        finally:
            for each in of_group(mark):
                os.kill(each, signal.SIGKILL)
