"""``t2`` as a process, and its child processes."""

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from verification.harness.support import wait_until

PATIENCE_S = 60.0


def t2(*words: str) -> list[str]:
    """Return the command line of ``t2``."""
    return [sys.executable, "-m", "cli", *words]


def ran(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run ``t2`` to completion."""
    return subprocess.run(
        t2(*words), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


def sets(*texts: str) -> list[str]:
    """Return settings as options."""
    return [word for text in texts for word in ("--set", text)]


def alive(pid: int) -> bool:
    """Return whether a process runs and is not a zombie."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state.split()[0] not in "ZX"


def children(pid: int) -> dict[str, int]:
    """Return the child processes of a ``t2``, by service name."""
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        listed = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
        return {name: int(each) for each in listed if (name := _service(int(each)))}
    return {}


def _service(pid: int) -> str:
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
        if "-m" in words:
            module, command = words[words.index("-m") + 1 :][:2]
            return command if module == "cli" else module.rpartition(".")[2]
    return ""


@contextlib.contextmanager
def running(command: Sequence[str], output: Path) -> "Iterator[subprocess.Popen[bytes]]":
    """Run a command with its output in a file; kill it and its children at the end."""
    with (
        output.open("wb") as file,
        subprocess.Popen(command, stdout=file, stderr=file) as process,
    ):
        try:
            yield process
        finally:
            left = children(process.pid)
            process.kill()
            for pid in left.values():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)


def wait_gone(pids: Sequence[int]) -> None:
    """Wait until all processes have ended."""
    wait_until(lambda: not any(map(alive, pids)), f"the end of {pids}", PATIENCE_S)
