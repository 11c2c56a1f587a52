"""A bridge of its own for each test, one router for all of a file."""

from collections.abc import Iterator

import pytest

from common.loop import Loop
from tests.bridge.bridge_fixture import BridgeFixture, bridge_process
from verification.harness.bus import bus_on, router_process, running
from verification.harness.fake_board import board
from verification.harness.ports import free_port


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """Share one router among these tests: each has a bridge of its own."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture
def bridge(endpoint: str) -> Iterator[BridgeFixture]:
    with (
        board() as made,
        bridge_process(made, endpoint) as process,
        running(Loop()) as loop,
    ):
        bridge = BridgeFixture(made, endpoint, loop, process)
        with bus_on(endpoint, loop, bridge.declare):
            yield bridge
