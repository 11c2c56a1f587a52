"""An integrator: a folder with the files of docs/integrate.md, and a stack for its programs.

A program is called as the page calls it, with the endpoint or the Zenoh configuration last.
"""

import contextlib
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import t2
from sim.requests import Sonar
from sim.trace import Truth
from verification.harness.stack import SETTINGS_FILE, RunningStack, running_stack
from verification.harness.waiting import wait_until

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "integrate.md"
SDK = ROOT / "sdk"
# A block with a file name after its language: ```python plain/drive.py
NAMED = re.compile(r"^```\w+ (?P<name>[\w./]+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
TRIES = 3  # safety stops the vehicle when a busy host stalls a program
# The longest that need no override, for such a host.
LEASES = (
    "safety.sources.patrol={priority=12, lease=0.5}",
    'safety.limits.detector={lease=1.0, silence="stop"}',
)
NO_REQUEST = {"no_request", "neutral"}


def save_files(page: Path, folder: Path) -> None:
    """Write each block of a page that has a file name to a folder."""
    for block in NAMED.finditer(page.read_text(encoding="utf-8")):
        file = folder / block["name"]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(block["text"], encoding="utf-8")


class Integrator:
    """A folder, the robot that its settings describe, and what the robot reports."""

    def __init__(self, folder: Path, stack: RunningStack, robot: t2.Robot) -> None:
        self.folder = folder
        self.stack = stack
        self.robot = robot

    def command(self, program: str, router: str = "") -> list[str]:
        """Return the command of a program: a Python file of the page, or an executable."""
        python = [sys.executable] if program.endswith(".py") else []
        return [*python, program, router or self.stack.endpoint]

    def check_end(self, code: int, reported: str, program: str, router: str = "") -> None:
        """Check exit code and error text of a program; on a busy host at the third try."""
        for _ in range(TRIES):
            done = subprocess.run(
                self.command(program, router), cwd=self.folder, env=environment(),
                capture_output=True, text=True, timeout=60, check=False,
            )  # fmt: skip
            if done.returncode == code and reported in done.stderr:
                return
            if code == 0:
                self.await_clear()
        raise AssertionError(done)

    @contextlib.contextmanager
    def running(self, program: str, router: str = "") -> Iterator["subprocess.Popen[str]"]:
        """Run a program during the context."""
        with subprocess.Popen(
            self.command(program, router), cwd=self.folder, env=environment(),
            stdout=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            try:
                yield process
            finally:
                process.kill()

    def driven(self, start: Truth) -> float:
        """Return the distance of the vehicle from where it was, in m."""
        truth = self.stack.control.truth()
        return math.dist((start.x, start.y), (truth.x, truth.y))

    def causes(self) -> set[str]:
        """Return the names of the causes that safety reports."""
        return {cause.name for cause in self.robot.safety.latest(timeout=5.0).causes}

    def await_clear(self) -> None:
        """Wait until nothing but a missing request stops the vehicle; reset what is latched."""

        def is_clear() -> bool:
            if self.robot.safety.latest(timeout=5.0).latched:
                with contextlib.suppress(t2.Refused):
                    self.robot.reset()
            return self.causes() <= NO_REQUEST

        wait_until(is_clear, "a vehicle that may drive")

    @contextlib.contextmanager
    def limited(self, program: str, router: str = "") -> Iterator["subprocess.Popen[str]"]:
        """Run a limit program, and wait until its limit is valid and the vehicle may drive.

        It starts after the lease of an earlier one: two publishers on one source are a conflict.
        """
        wait_until(lambda: self.limit().silent, "the end of an earlier limit")
        with self.running(program, router) as process:
            wait_until(lambda: not self.limit().silent, "the limit")
            self.await_clear()
            yield process

    def limit(self) -> t2.messages.LimitState:
        """Return what safety reports of the limit source of the page."""
        (limit,) = self.robot.safety.latest(timeout=5.0).limit_sources
        assert limit.source == "detector"
        return limit

    @contextlib.contextmanager
    def obstacle(self, range_m: float) -> Iterator[None]:
        """Make the front sonar measure an obstacle during the context."""
        self.stack.control.do(Sonar(name="front", range=range_m))
        try:
            yield
        finally:
            self.stack.control.do(Sonar(name="front"))


@contextlib.contextmanager
def running_integrator(
    folder: Path, *, sets: Sequence[str] = (), listen: str = "tcp/127.0.0.1:{port}"
) -> Iterator[Integrator]:
    """Run a stack with the settings of the page, in an empty world; see ``running_stack``."""
    save_files(PAGE, folder)
    settings = [
        (folder / name).read_text(encoding="utf-8") for name in ("robot.toml", "limit.toml")
    ]
    (folder / SETTINGS_FILE).write_text("\n".join(settings), encoding="utf-8")
    with (
        running_stack(folder, sets=(*LEASES, *sets), listen=listen) as stack,
        t2.connect("001", endpoint=stack.endpoint) as robot,
    ):
        robot.odometry.latest(timeout=20.0)
        yield Integrator(folder, stack, robot)


def environment() -> dict[str, str]:
    """Return the environment of an integrator who has installed the package t2."""
    return {**os.environ, "PYTHONPATH": str(SDK), "PYTHONUNBUFFERED": "1"}


def lines_until(process: "subprocess.Popen[str]", true: Callable[[str], bool]) -> list[str]:
    """Return the output of a program up to the line for which ``true`` is."""
    lines: list[str] = []
    assert process.stdout is not None
    for line in process.stdout:
        lines.append(line)
        if true(line):
            return lines
    raise AssertionError(f"ended with {process.wait()}: {lines}")
