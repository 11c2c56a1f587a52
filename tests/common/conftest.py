"""A robot of its own for each test, on the shared router."""

from collections.abc import Iterator

import pytest

from common import log
from tests.common.bus_fixture import BusFixture
from verification.harness.bus import Lines


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
