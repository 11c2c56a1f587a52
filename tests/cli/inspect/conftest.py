"""The rig of ``tests/common``, and ``t2`` on its robot."""

import pytest

from tests.cli.inspect.tool import Tool
from tests.common.bus_fixture import Rig
from tests.common.conftest import rig, shared_router

__all__ = ["rig", "shared_router", "tool"]


@pytest.fixture
def tool(rig: Rig, capsys: pytest.CaptureFixture[str]) -> Tool:
    """Run ``t2`` on that robot."""
    return Tool(rig.endpoint, rig.robot, capsys)
