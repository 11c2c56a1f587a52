"""The rig of ``tests/common``, and ``t2`` on its robot."""

import pytest

from tests.cli.inspect.tool import Tool
from tests.common.bus_fixture import BusFixture
from tests.common.conftest import buses as rig
from tests.common.conftest import shared_router

__all__ = ["rig", "shared_router", "tool"]


@pytest.fixture
def tool(rig: BusFixture, capsys: pytest.CaptureFixture[str]) -> Tool:
    """Run ``t2`` on that robot."""
    return Tool(rig.endpoint, rig.robot, capsys)
