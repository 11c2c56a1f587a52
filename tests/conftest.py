"""Fixtures of the integration tests."""

from collections.abc import Iterator

import pytest
import structlog
from hypothesis import settings

from tests.support import free_port, router_process

# Two noisy cores: how long an example takes says nothing.
settings.register_profile("t2", deadline=None)
settings.load_profile("t2")


@pytest.fixture(autouse=True)
def _own_logs() -> Iterator[None]:
    """Undo what a service or command that ran in this process has set for its logs."""
    structlog.reset_defaults()
    yield
    structlog.reset_defaults()


@pytest.fixture
def endpoint() -> Iterator[str]:
    """Run a real router on an ephemeral port for one test, and name its endpoint."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where
