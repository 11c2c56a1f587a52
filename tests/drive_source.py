"""A motion source for the whole stack, and the commands that the board received meanwhile."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[RunningStack]:
    with running_stack(tmp_path) as it:
        yield it


class ConstantSource:
    """A source that requests ``linear`` without a pause, until it is None."""

    def __init__(self, loop: Loop) -> None:
        self.linear: float | None = 0.0  # m/s; None: no request, and no zero before
        self._loop = loop

    def declare(self, bus: Bus) -> None:
        source = DriveSource(bus, "teleop")

        def publish(_: int) -> None:
            if self.linear is not None:
                source.request(self.linear, 0.0)

        self._loop.post(lambda: self._loop.every(0.05, publish))


@pytest.fixture
def source(stack: RunningStack) -> Iterator[ConstantSource]:
    with running(Loop()) as loop:
        source = ConstantSource(loop)
        with bus_on(stack.endpoint, loop, source.declare):
            yield source


def drive_until_moving(stack: RunningStack, source: ConstantSource) -> None:
    """Push the source until the vehicle moves; center it first when safety wants a neutral."""
    for _ in range(10):
        source.linear = 0.0
        centered = partial(kinds_since, stack, len(stack.trace().commands))
        wait_until(lambda: "run" in centered(), "a neutral is taken")  # noqa: B023
        source.linear = 0.5
        try:
            wait_until(lambda: stack.speed() > 0.1, "the vehicle moves", patience_s=6)
        except AssertionError:
            continue
        return
    raise AssertionError(f"never drove: {stack.log.read_text()[-3000:]}")


def kinds_since(stack: RunningStack, count: int) -> set[str]:
    """Return what was commanded after that many commands."""
    return {command.kind for command in stack.trace().commands[count:]}


def moves_since(stack: RunningStack, count: int) -> bool:
    """Return whether one of the hundred commands after the first ``count`` moves the vehicle."""
    wait_until(lambda: len(stack.trace().commands) > count + 100, "a hundred commands")
    return any(c.kind == "run" and (c.linear or c.angular) for c in stack.trace().commands[count:])
