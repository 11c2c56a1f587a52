"""Fixtures of the client library: one stack for all tests, a connection for each."""

from collections.abc import Iterator

import pytest

import t2
from tests.sdk.library_robot import library_stack, ready
from verification.harness.stack import RunningStack


@pytest.fixture(scope="package")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    """Yield a running stack."""
    with library_stack(tmp_path_factory.mktemp("sdk")) as it:
        yield it


@pytest.fixture
def robot(stack: RunningStack) -> Iterator[t2.Robot]:
    """Yield a robot that may drive."""
    with ready(stack) as it:
        yield it
