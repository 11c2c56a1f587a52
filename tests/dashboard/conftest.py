"""A router, its simulated safety and a dashboard, for the tests of one module."""

from collections.abc import Iterator

import pytest

from common.loop import Loop
from tests.dashboard.bus_fixture import Peer
from verification.harness.bus import bus_on, router_process, running
from verification.harness.dashboard import Server, dashboard
from verification.harness.ports import free_port


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture(scope="module")
def peer(endpoint: str) -> Iterator[Peer]:
    with running(Loop()) as loop:
        peer = Peer(loop)
        with bus_on(endpoint, loop, peer.declare):
            yield peer


@pytest.fixture(scope="module")
def server(endpoint: str, peer: Peer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with dashboard(endpoint, tmp_path_factory.mktemp("server"), "dashboard.round_trip=0.5") as it:
        yield it
