"""One router for all these tests; each test has a robot of its own on it."""

from collections.abc import Iterator

import pytest

from common import log
from tests.common.bus_fixture import BusFixture
from verification.harness.bus import Lines, router_process
from verification.harness.ports import free_port


@pytest.fixture(scope="package")
def shared_router() -> Iterator[str]:
    """Run a real router, and name its endpoint."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture
def buses(shared_router: str) -> Iterator[BusFixture]:
    """Give a robot, and buses of it."""
    with BusFixture(shared_router) as made:
        yield made


@pytest.fixture
def lines() -> Lines:
    """Collect what is logged."""
    said: Lines = []
    log.redirect(lambda *line: said.append(line), "debug")
    return said
