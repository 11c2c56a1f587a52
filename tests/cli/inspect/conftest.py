"""One router for all these tests; each has a robot of its own on it, and ``t2`` to look at it."""

from collections.abc import Iterator

import pytest

from tests.cli.inspect.tool import Tool
from tests.common.rig import Rig
from tests.support import free_port, router_process


@pytest.fixture(scope="package")
def shared_router() -> Iterator[str]:
    """Run a real router, and name its endpoint."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture
def rig(shared_router: str) -> Iterator[Rig]:
    """Give a robot, and buses of it."""
    with Rig(shared_router) as made:
        yield made


@pytest.fixture
def tool(rig: Rig, capsys: pytest.CaptureFixture[str]) -> Tool:
    """Run ``t2`` on that robot."""
    return Tool(rig.endpoint, rig.robot, capsys)
