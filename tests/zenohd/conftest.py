"""One stack on one zenohd for a module's tests: they look at it, and leave it standing."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from common.loop import Loop
from tests.drive_source import ConstantSource
from tests.zenohd.router import command, found
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack, running_stack


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    """Run the stack on zenohd."""
    zenohd = found()
    folder: Path = tmp_path_factory.mktemp("stack")
    with running_stack(folder, route=partial(command, zenohd, folder)) as it:
        yield it


@pytest.fixture
def source(stack: RunningStack) -> Iterator[ConstantSource]:
    """Be a source that asks without a pause."""
    with running(Loop()) as loop:
        it = ConstantSource(loop)
        with bus_on(stack.endpoint, loop, it.declare):
            yield it
