"""The real processes of a tree, on their own ports and in their own folder."""

import contextlib
import itertools
import os
import random
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

COMMANDS = {"router": ("cli", "router"), "up": ("cli", "up", "--no-sim")}
SERVICES = ("router", "bridge", "safety", "odom")
END_S = 3.0
PORTS = itertools.cycle(random.sample(range(33_000, 60_000), 20_000))


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """Return a port of 127.0.0.1 that is free at the moment."""
    while True:
        port = next(PORTS)
        with socket.socket(socket.AF_INET, kind) as sock, contextlib.suppress(OSError):
            sock.bind(("127.0.0.1", port))
            return port


def wait_for(true: Callable[[], object], seconds: float) -> bool:
    """Return whether a condition becomes true within a time."""
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def ordinary() -> list[str]:
    """Return the prefix of a command that resets a real-time priority of this process."""
    chrt = shutil.which("chrt")
    return [chrt, "--other", "0"] if chrt and os.sched_getscheduler(0) else []


class Stack:
    """Router, bridge, safety and odometry of one tree."""

    def __init__(self, tree: Path, sets: Sequence[str]) -> None:
        self.tree = tree
        self.folder = Path(tempfile.mkdtemp(prefix="t2-outside-"))
        self.folder.chmod(0o700)
        self.endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        self.sets = [f"bus.listen={self.endpoint}", *sets]
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        # The runtime directory has the stack's sockets: each run has its own.
        self.env = {**os.environ, "XDG_RUNTIME_DIR": str(self.folder), "PYTHONPATH": ""}

    def command(self, *words: str) -> list[str]:
        """Return a command of the tree's own Python with this stack's settings."""
        passed = [word for each in self.sets for word in ("--set", each)]
        return [str(self.tree / ".venv/bin/python"), "-m", *words, *passed]

    def start(self, name: str) -> "subprocess.Popen[bytes]":
        words = COMMANDS.get(name, (f"services.{name}",))
        with (self.folder / "log").open("ab") as log:
            process = subprocess.Popen(
                [*ordinary(), *self.command(*words)], cwd=self.tree, env=self.env,
                stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        self.processes[name] = process
        return process

    def start_all(self, *, supervised: bool = False) -> None:
        """Start the router, wait until it listens, and start the services; or ``t2 up``."""
        self.start("up" if supervised else "router")
        host, _, port = self.endpoint.removeprefix("tcp/").partition(":")
        if not wait_for(lambda: _listens(host, int(port)), 20):
            raise RuntimeError(f"the router does not listen: {self.log()}")
        for name in () if supervised else SERVICES[1:]:
            self.start(name)

    def kill(self, name: str) -> None:
        """Kill a process with SIGKILL."""
        self.processes[name].kill()
        self.processes[name].wait()

    def run(
        self, *words: str, sets: Sequence[str] = (), timeout: float = 15.0
    ) -> tuple[int | None, str]:
        """Run a command of the tree; return its exit code, None after a timeout, and its output."""
        passed = [word for each in sets for word in ("--set", each)]
        process = subprocess.Popen(
            [*ordinary(), *self.command(*words), *passed], cwd=self.tree, env=self.env,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
        )  # fmt: skip
        try:
            out, _ = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            out, _ = process.communicate()
            return None, out
        return process.returncode, out

    def log(self) -> str:
        return (self.folder / "log").read_text(errors="replace")[-2000:]

    def close(self) -> None:
        """End all processes: SIGTERM to the services, then SIGKILL to each process group."""
        for name, process in self.processes.items():
            if name != "router" and process.poll() is None:
                process.terminate()
        end = time.monotonic() + END_S
        for name, process in self.processes.items():
            with contextlib.suppress(subprocess.TimeoutExpired):
                if name != "router":
                    process.wait(max(0.0, end - time.monotonic()))
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        for pid in self._escaped():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _escaped(self) -> list[int]:
        """Return the processes of this stack outside their groups, found by their folder."""
        mark, found = f"XDG_RUNTIME_DIR={self.folder}".encode(), []
        for path in Path("/proc").glob("[0-9]*/environ"):
            with contextlib.suppress(OSError):
                if mark in path.read_bytes().split(b"\0"):
                    found.append(int(path.parent.name))
        return found


def _listens(host: str, port: int) -> bool:
    with socket.socket() as sock:
        return sock.connect_ex((host, port)) == 0


@contextlib.contextmanager
def stall_meter() -> Iterator[list[float]]:
    """Measure the longest stall of this host; it is appended to the list at the end."""
    found: list[float] = []
    program = (
        "import signal,sys,time\n"
        "signal.signal(15, lambda *_: (print(worst), sys.exit()))\n"
        "worst, last = 0.0, time.monotonic()\n"
        "while 1:\n"
        "    time.sleep(.005)\n"
        "    now = time.monotonic()\n"
        "    worst, last = max(worst, now - last - .005), now\n"
    )
    command = ["python3", "-S", "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield found
        finally:
            process.terminate()
            out, _ = process.communicate()
            found.append(float(out or 0))
