"""Fixtures of the integration tests."""

import logging
import os
import signal
from collections.abc import Generator, Iterator

import pytest
from hypothesis import settings

from common import log
from common.bus.session import RUNTIME_ENV
from tests.untraced import untraced
from verification.harness.bus import router_process
from verification.harness.ports import free_port

# On two busy cores, the duration of an example is not meaningful.
settings.register_profile("t2", deadline=None)
settings.load_profile("t2")
os.environ["T2_LANG"] = "en"  # whatever the locale of this host


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Leave property tests and long runs out of the coverage.

    A branch that only chance reaches is not tested.
    """
    if not any(map(item.get_closest_marker, ("hypothesis", "no_cover"))):
        return (yield)
    with untraced():
        return (yield)


@pytest.fixture(autouse=True)
def _own_logs() -> Iterator[None]:
    """Undo what a service or command that ran in this process has set for its logs."""
    root, ours = logging.getLogger(), logging.getLogger(log.NAME)
    before = root.handlers[:], root.level, ours.level
    yield
    for handler in root.handlers[:]:
        if isinstance(handler, log.Output | log.Callback) and handler not in before[0]:
            root.removeHandler(handler)
    root.setLevel(before[1])
    ours.setLevel(before[2])


@pytest.fixture(autouse=True)
def _own_runtime() -> Iterator[None]:
    """Undo what a service that ran in this process has set for Zenoh in its children."""
    before = os.environ.get(RUNTIME_ENV)
    yield
    if before is None:
        os.environ.pop(RUNTIME_ENV, None)


@pytest.fixture(autouse=True)
def _own_signals() -> Iterator[None]:
    """Undo what a service that ran in this process has set for its signals."""
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def shared_router() -> Iterator[str]:
    """Run one real router for all tests that leave it as it is, and name its endpoint."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture
def endpoint() -> Iterator[str]:
    """Run a real router on an ephemeral port for one test, and name its endpoint."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where
