"""The shared harness: reactions in a trace, a growing one, trees of processes."""

import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from common import motion
from sim.trace import Command
from verification.harness.process_stats import tree
from verification.harness.trace import TraceFollower, first_stop_s, last_move_s
from verification.harness.waiting import wait_until

RUN, STOP, BRAKE = motion.Command
PARENT = """
import subprocess, threading
threading.Thread(target=lambda: subprocess.run(["sleep", "1000"])).start()
"""


def command(ms: float, kind: motion.Command = RUN, linear: float = 0.8) -> Command:
    return Command(mono_ns=round(ms * 1e6), kind=kind, linear=linear, angular=0.0)


def test_the_first_stop_and_the_last_move_after_a_fault() -> None:
    made = [
        command(0, STOP, 0), command(90), command(100), command(110), command(120, BRAKE, 0),
        command(130), command(140, STOP, 0), command(150, linear=0.0),
    ]  # fmt: skip
    assert first_stop_s(made, round(100e6)) == pytest.approx(0.020)
    assert last_move_s(made, round(100e6)) == pytest.approx(0.030)
    assert first_stop_s(made[:4], round(100e6)) is None
    assert last_move_s(made, round(131e6)) == 0.0


def test_a_growing_trace_is_read_by_whole_lines(tmp_path: Path) -> None:
    path = tmp_path / "trace"
    follower = TraceFollower(path)
    assert follower.follow().commands == []
    first, second = (msgspec.json.encode(command(ms)) + b"\n" for ms in (1, 2))
    with path.open("ab", buffering=0) as file:
        file.write(first + second[:9])
        assert [one.mono_ns for one in follower.follow().commands] == [1_000_000]
        file.write(second[9:])
        assert [one.mono_ns for one in follower.follow().commands] == [1_000_000, 2_000_000]


def test_the_tree_has_children_that_a_thread_started() -> None:
    with subprocess.Popen([sys.executable, "-c", PARENT]) as process:
        try:
            wait_until(lambda: len(list(tree("it", process.pid))) == 2, "the child")
            (_, own), (name, _) = tree("it", process.pid)
            assert (own, name) == (process.pid, "it/1")
        finally:
            for _, pid in tree("it", process.pid):
                os.kill(pid, 9)
    assert list(tree("it", process.pid)) == [("it", process.pid)]
