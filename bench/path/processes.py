"""Processes that last as long as their context, and the packages that they need."""

import contextlib
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Protocol

from common.bus.session import ONE_POOL, RUNTIME_ENV

Command = Sequence[str]
ROBOTS = Path("out/robot/bin/python")
SCHED_FIFO = "bench.path.sched_fifo"  # before the name of a module


@contextlib.contextmanager
def running(*commands: Command) -> Iterator[None]:
    """Run these processes while the context lasts."""
    with contextlib.ExitStack() as stack:
        for command in commands:
            process = stack.enter_context(
                subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            )
            stack.callback(process.kill)
        yield


@contextlib.contextmanager
def loaded(processes: int) -> Iterator[None]:
    """Run processes with a busy loop."""
    with running(*[[sys.executable, "-S", "-c", "while True: pass"]] * processes):
        yield


def module(name: str, *words: object) -> Command:
    """Return the command that runs a module."""
    return [sys.executable, "-m", *name.split(), *map(str, words)]


def one_pool(command: Command) -> Command:
    """Return the command with Zenoh's runtimes on one pool of threads, as T2's services set it."""
    return ["env", f"{RUNTIME_ENV}={ONE_POOL.format(links=1)}", *command]


def robots_python() -> str:
    """Return a Python with only a robot's packages, made by `make bench`, else this Python.

    Libraries import optional packages of laptops when installed; that costs memory and time.
    """
    return str(ROBOTS) if ROBOTS.exists() else sys.executable


def packages() -> str:
    """Return which packages that Python has."""
    return "a robot's packages" if ROBOTS.exists() else "all packages of this checkout"


def compiled(source: Path, folder: Path) -> Path:
    """Compile a C program into a folder; raise ``FileNotFoundError`` where there is no compiler."""
    if shutil.which("cc") is None:
        raise FileNotFoundError("no C compiler (Debian: apt-get install gcc libc6-dev)")
    made = folder / source.stem
    subprocess.run(["cc", "-O2", "-Wall", "-Werror", "-o", str(made), str(source)], check=True)
    return made


def lacking(package: str) -> str:
    """Return the package if it is missing, else an empty string."""
    try:
        if package:
            version(package)
    except PackageNotFoundError:
        return package
    return ""


class Optional(Protocol):
    """A row of a table that may need a package."""

    @property
    def name(self) -> str:
        """Title of the row."""

    @property
    def package(self) -> str:
        """The required package, by its name in requirements-bench.lock; may be empty."""

    @property
    def lacks(self) -> str:
        """The missing package; empty when the row can run."""


def versions(rows: Sequence[Optional]) -> str:
    """Return the compared packages with versions, and the rows that are left out."""
    here = [row.package for row in rows if row.package and not row.lacks]
    versions_here = [f"{name} {version(name)}" for name in ("eclipse-zenoh", *here)]
    left_out = [f"{row.name} left out, {row.lacks} is not installed" for row in rows if row.lacks]
    return ", ".join([*dict.fromkeys(versions_here), *left_out])
