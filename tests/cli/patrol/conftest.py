"""The buses of ``tests/common``, and ``t2`` on its robot."""

from tests.cli.inspect.conftest import tool
from tests.common.conftest import buses

__all__ = ["buses", "tool"]
