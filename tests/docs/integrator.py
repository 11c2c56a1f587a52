"""An integrator: a folder with the examples of docs/integrate.md, and a stack for them."""

import contextlib
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import t2
from sim.requests import Sonar
from sim.trace import Truth
from tests.sdk.library_robot import blocked
from verification.harness.stack import SETTINGS_FILE, RunningStack, running_stack
from verification.harness.waiting import wait_until

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "integrate.md"
# The environment of an integrator who has installed the package t2.
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT / "sdk"), "PYTHONUNBUFFERED": "1"}
# A block with a file name after its language: ```python plain/drive.py
NAMED = re.compile(r"^```\w+ (?P<name>[\w./]+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
TRIES = 3  # safety stops the vehicle when a busy host stalls a program
# The longest that need no override, for such a host.
LEASES = (
    "safety.sources.shuttle={priority=12, lease=0.5}",
    'safety.limits.detector={lease=1.0, silence="stop"}',
)


def save_files(folder: Path) -> None:
    """Write the blocks of the page that have a file name to a folder; copy the examples to it."""
    for block in NAMED.finditer(PAGE.read_text(encoding="utf-8")):
        (folder / block["name"]).write_text(block["text"], encoding="utf-8")
    shutil.copytree(ROOT / "examples" / "plain", folder / "plain")
    for file in (ROOT / "examples").glob("*.py"):
        shutil.copy(file, folder)


class Integrator:
    """A folder, the robot that its settings describe, and what the robot reports."""

    def __init__(self, folder: Path, stack: RunningStack, robot: t2.Robot) -> None:
        self.folder = folder
        self.stack = stack
        self.robot = robot

    def start(self, program: str, router: str = "") -> "subprocess.Popen[str]":
        """Start a program, a Python file or an executable, as the page does."""
        python = [sys.executable] if program.endswith(".py") else []
        return subprocess.Popen(
            [*python, program, router or self.stack.endpoint], cwd=self.folder, env=ENVIRONMENT,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    @contextlib.contextmanager
    def running(self, program: str, router: str = "") -> Iterator["subprocess.Popen[str]"]:
        """Run a program during the context."""
        with self.start(program, router) as process:
            try:
                yield process
            finally:
                process.kill()

    def check_drive(self, program: str, router: str = "") -> None:
        """Check that a source drives and ends without an error; on a busy host at the third try."""
        for _ in range(TRIES):
            wait_until(lambda: not blocked(self.robot), "a vehicle that may drive")
            start = self.stack.control.truth()
            process = self.start(program, router)
            errors = process.communicate(timeout=60)[1]
            assert process.returncode == bool(errors)
            if not errors and 0.2 < self.driven(start) < 0.6:
                return
        raise AssertionError(errors or "the vehicle does not drive as it should")

    def driven(self, start: Truth) -> float:
        """Return the distance of the vehicle from where it was, in m."""
        truth = self.stack.control.truth()
        return math.dist((start.x, start.y), (truth.x, truth.y))

    @contextlib.contextmanager
    def limited(self, program: str, router: str = "") -> Iterator["subprocess.Popen[str]"]:
        """Run a limit program, and wait until its limit is valid and the vehicle may drive.

        It starts after the lease of an earlier one: two publishers on one source are a conflict.
        """
        wait_until(lambda: self.limit().silent, "the end of an earlier limit")
        with self.running(program, router) as process:
            wait_until(lambda: not self.limit().silent, "the limit")
            wait_until(lambda: not blocked(self.robot), "a vehicle that may drive")
            yield process

    def limit(self) -> t2.messages.LimitState:
        """Return what safety reports of the limit source of the page."""
        (limit,) = self.robot.safety.latest(timeout=5.0).limit_sources
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
    save_files(folder)
    settings = [(folder / name).read_text("utf-8") for name in ("robot.toml", "limit.toml")]
    (folder / SETTINGS_FILE).write_text("\n".join(settings), encoding="utf-8")
    with (
        running_stack(folder, sets=(*LEASES, *sets), listen=listen) as stack,
        t2.connect("001", endpoint=stack.endpoint) as robot,
    ):
        robot.odometry.latest(timeout=20.0)
        yield Integrator(folder, stack, robot)
