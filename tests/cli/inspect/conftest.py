"""The buses of ``tests/common``, and ``t2`` on its robot."""

import pytest

from tests.cli.inspect.tool import Tool
from tests.common.bus_fixture import BusFixture
from tests.common.conftest import buses

__all__ = ["buses", "tool"]


@pytest.fixture
def tool(buses: BusFixture, capsys: pytest.CaptureFixture[str]) -> Tool:
    """Run ``t2`` on that robot."""
    return Tool(buses.endpoint, buses.robot, capsys)
