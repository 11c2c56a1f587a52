"""A router, a world on it and a dashboard that shows it, for the tests of one file."""

from collections.abc import Iterator

import pytest

from common.loop import Loop
from tests.dashboard.bus_fixture import World
from verification.harness.bus import bus_on, router_process, running
from verification.harness.dashboard import Site, dashboard
from verification.harness.ports import free_port


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture(scope="module")
def world(endpoint: str) -> Iterator[World]:
    with running(Loop()) as loop:
        world = World(loop)
        with bus_on(endpoint, loop, world.declare):
            yield world


@pytest.fixture(scope="module")
def site(endpoint: str, world: World, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with dashboard(endpoint, tmp_path_factory.mktemp("site"), "dashboard.round_trip=0.5") as it:
        yield it
