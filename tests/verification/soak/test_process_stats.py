"""What the system tells of processes and files, asked about this very process."""

import os
import subprocess
import sys
import threading
from pathlib import Path

from verification.harness.support import wait_until
from verification.soak.process_stats import Tail, look, tree

PARENT = """
import subprocess, sys, threading
def start():
    subprocess.Popen(["sleep", "1000"])
    threading.Event().wait()
threading.Thread(target=start).start()
"""


def test_a_process_is_seen_with_what_it_holds(tmp_path: Path) -> None:
    found = look("me", os.getpid(), 3.0)
    assert found is not None
    life, before = found
    assert (life.name, life.pid, before.at_s) == ("me", os.getpid(), 3.0)
    assert before.rss > 10 * 2**20
    let_go = threading.Event()
    thread = threading.Thread(target=let_go.wait)
    thread.start()
    with (tmp_path / "file").open("wb"):
        again = look("me", os.getpid(), 4.0)
    let_go.set()
    thread.join()
    assert again is not None
    assert again[0] == life, "the same incarnation"
    assert again[1].threads == before.threads + 1
    assert again[1].descriptors == before.descriptors + 1


def test_a_process_that_is_gone_is_not_seen() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        # Ended and not waited for: a mere entry in the table.
        wait_until(lambda: look("it", process.pid, 0.0) is None, "the end")
    assert look("it", process.pid, 0.0) is None
    assert list(tree("it", process.pid)) == [("it", process.pid)]


def test_what_a_thread_of_a_process_has_started_is_found() -> None:
    with subprocess.Popen([sys.executable, "-c", PARENT]) as process:
        try:
            wait_until(lambda: len(list(tree("it", process.pid))) == 2, "the child")
            (_, own), (name, child) = tree("it", process.pid)
            assert (own, name) == (process.pid, "it/1")
            assert look(name, child, 0.0) is not None
        finally:
            for _, pid in tree("it", process.pid):
                os.kill(pid, 9)


def test_a_growing_file_is_read_by_whole_lines(tmp_path: Path) -> None:
    tail = Tail(tmp_path / "log")
    assert tail.read() == b""
    with (tmp_path / "log").open("ab", buffering=0) as file:
        file.write(b"one\ntw")
        assert tail.read() == b"one\n"
        assert tail.read() == b""
        file.write(b"o\nthree\n")
        assert tail.read() == b"two\nthree\n"
    assert tail.bytes == 14


def test_a_file_that_was_begun_anew_is_read_from_its_start(tmp_path: Path) -> None:
    file, tail = tmp_path / "trace", Tail(tmp_path / "trace")
    file.write_bytes(b"a long line\n")
    assert tail.read() == b"a long line\n"
    file.write_bytes(b"new\n")
    assert tail.read() == b"new\n"
