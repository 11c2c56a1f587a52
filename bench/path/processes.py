"""Processes that run while a context lasts, and what they want installed."""

import contextlib
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Protocol

Command = Sequence[str]
ROBOTS = Path("out/robot/bin/python")


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
    """Keep so many processes counting while the context lasts."""
    with running(*[[sys.executable, "-S", "-c", "while True: pass"]] * processes):
        yield


def module(name: str, *words: object) -> Command:
    """Return how a module is run."""
    return [sys.executable, "-m", *name.split(), *map(str, words)]


def robots_python() -> str:
    """Return a Python with a robot's packages alone, which `make bench` makes; without it, ours.

    What laptops want is found by libraries that can do without, and costs each process on board.
    """
    return str(ROBOTS) if ROBOTS.exists() else sys.executable


def packages() -> str:
    """Say whose packages that Python has."""
    return "a robot's packages" if ROBOTS.exists() else "all packages of this checkout"


def given(*sets: str) -> list[str]:
    """Return settings as options."""
    return [word for each in sets for word in ("--set", each)]


def compiled(source: Path, folder: Path) -> Path:
    """Compile a C program into a folder; raise ``FileNotFoundError`` where there is no compiler."""
    if shutil.which("cc") is None:
        raise FileNotFoundError("no C compiler (Debian: apt-get install gcc libc6-dev)")
    made = folder / source.stem
    subprocess.run(["cc", "-O2", "-Wall", "-Werror", "-o", str(made), str(source)], check=True)
    return made


def lacking(package: str, program: str) -> str:
    """Return what of these is not installed here; both may be empty."""
    try:
        if package:
            version(package)
    except PackageNotFoundError:
        return package
    return program if program and shutil.which(program) is None else ""


def answers(port: int) -> bool:
    """Tell whether somebody listens on a port of loopback."""
    with socket.socket() as sock:
        return sock.connect_ex(("127.0.0.1", port)) == 0


class Wanting(Protocol):
    """A row of a table that may want a package."""

    @property
    def name(self) -> str:
        """What the row is called."""

    @property
    def package(self) -> str:
        """What it wants, by its name in requirements-bench.lock; may be empty."""

    @property
    def lacks(self) -> str:
        """What is not installed here; empty when it can run."""


def versions(rows: Sequence[Wanting]) -> str:
    """Return what is compared, with versions, and what is not here."""
    here = [row.package for row in rows if row.package and not row.lacks]
    told = [f"{name} {version(name)}" for name in ("eclipse-zenoh", *here)]
    left_out = [f"{row.name} left out, {row.lacks} is not installed" for row in rows if row.lacks]
    return ", ".join([*dict.fromkeys(told), *left_out])
