"""Processes that last as long as their context, what they need, and the CPU that they take."""

import contextlib
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from common import realtime
from common.bus.session import ONE_POOL, RUNTIME_ENV
from common.freshness import NS_PER_S
from verification.harness.process_stats import GONE, main_thread_s, stat

Command = Sequence[str]


class MissingError(Exception):
    """Something that a benchmark needs is not there; the text is for the page."""


@contextlib.contextmanager
def running(*commands: Command) -> Iterator[list["subprocess.Popen[bytes]"]]:
    """Run these processes while the context lasts."""
    with contextlib.ExitStack() as stack:
        processes = []
        for command in commands:
            process = stack.enter_context(
                subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            )
            stack.callback(process.kill)
            processes.append(process)
        yield processes


def module(name: str, *words: object) -> Command:
    """Return the command that runs a module."""
    return [sys.executable, "-m", name, *map(str, words)]


def one_pool(command: Command) -> Command:
    """Return the command with Zenoh's runtimes on one pool of threads, as T2's services set it."""
    return ["env", f"{RUNTIME_ENV}={ONE_POOL.format(links=1)}", *command]


def on_one_cpu(command: Command) -> Command:
    """Return the command that runs on the CPU of ``realtime.share_cpu``."""
    return ["taskset", "--cpu-list", str(realtime.shared_cpu()), *command]


def compiled(name: str, folder: Path) -> str:
    """Compile a C program of this package into a folder; return its path."""
    if shutil.which("cc") is None:
        raise MissingError("no C compiler (Debian: apt-get install gcc libc6-dev)")
    made = str(folder / name)
    source = Path(__file__).with_name(f"{name}.c")
    subprocess.run(["cc", "-O2", "-Wall", "-Werror", "-o", made, source], check=True)
    return made


class Share(NamedTuple):
    """CPU of a process, in ns/s or ns: of all threads, and of its main thread alone."""

    total: float
    main: float


def cpu_shares(pids: Mapping[str, int], seconds: float) -> dict[str, Share]:
    """Return the CPU shares of processes in ns/s; without those that end meanwhile."""
    before, since_s = _used(pids), time.monotonic()
    time.sleep(seconds)
    past_s = time.monotonic() - since_s
    return {
        name: Share((now.total - old.total) / past_s, (now.main - old.main) / past_s)
        for name, now in _used(pids).items()
        if (old := before.get(name))
    }


def _used(pids: Mapping[str, int]) -> dict[str, Share]:
    found: dict[str, Share] = {}
    for name, pid in pids.items():
        with contextlib.suppress(*GONE):
            found[name] = Share(stat(pid).cpu_s * NS_PER_S, main_thread_s(pid) * NS_PER_S)
    return found
