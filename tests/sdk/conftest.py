"""Fixtures of the client library: a real stack for all tests, and a simulated one for each."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import t2
from tests.sdk.library_robot import blocked, library_stack, ready
from tests.simulated_robot import SimulatedStack, simulated_robot
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until


@pytest.fixture(scope="package")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    """Yield a running stack."""
    with library_stack(tmp_path_factory.mktemp("sdk")) as it:
        yield it


@pytest.fixture
def robot(stack: RunningStack) -> Iterator[t2.Robot]:
    """Yield a robot that may drive."""
    with ready(stack) as it:
        it.patrol.latest(timeout=20.0)
        yield it


@pytest.fixture
def simulated_stack(tmp_path: Path) -> Iterator[SimulatedStack]:
    """Yield a stack in simulated time; its oracle has nothing to object to."""
    stack = SimulatedStack("empty", tmp_path)
    yield stack
    assert stack.oracle.violations == []


@pytest.fixture
def simulated(simulated_stack: SimulatedStack) -> Iterator[t2.Robot]:
    """Yield a robot in simulated time that may drive."""
    with simulated_robot(simulated_stack) as it:
        it.odometry.latest(timeout=20.0)
        wait_until(lambda: not blocked(it), "a vehicle that may drive")
        yield it
