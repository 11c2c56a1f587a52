"""Statistics of processes, read for this very process."""

import os
import subprocess
import sys
import threading
from pathlib import Path

from verification.harness.process_stats import tree
from verification.harness.waiting import wait_until
from verification.soak.runner import sample_process

PARENT = """
import subprocess, sys, threading
def start():
    subprocess.Popen(["sleep", "1000"])
    threading.Event().wait()
threading.Thread(target=start).start()
"""


def test_a_sample_has_memory_threads_and_descriptors(tmp_path: Path) -> None:
    found = sample_process("me", os.getpid(), 3.0)
    assert found is not None
    process, before = found
    assert (process.name, process.pid, before.at_s) == ("me", os.getpid(), 3.0)
    assert before.rss > 10 * 2**20
    let_go = threading.Event()
    thread = threading.Thread(target=let_go.wait)
    thread.start()
    with (tmp_path / "file").open("wb"):
        again = sample_process("me", os.getpid(), 4.0)
    let_go.set()
    thread.join()
    assert again is not None
    assert again[0] == process, "the same incarnation"
    assert again[1].threads == before.threads + 1
    assert again[1].descriptors == before.descriptors + 1


def test_an_ended_process_has_no_sample() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        # Ended and not waited for: a mere entry in the table.
        wait_until(lambda: sample_process("it", process.pid, 0.0) is None, "the end")
    assert sample_process("it", process.pid, 0.0) is None
    assert list(tree("it", process.pid)) == [("it", process.pid)]


def test_the_tree_has_children_that_a_thread_started() -> None:
    with subprocess.Popen([sys.executable, "-c", PARENT]) as process:
        try:
            wait_until(lambda: len(list(tree("it", process.pid))) == 2, "the child")
            (_, own), (name, child) = tree("it", process.pid)
            assert (own, name) == (process.pid, "it/1")
            assert sample_process(name, child, 0.0) is not None
        finally:
            for _, pid in tree("it", process.pid):
                os.kill(pid, 9)
