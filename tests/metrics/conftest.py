"""A router for all these tests, and a robot on it for each."""

from tests.cli.inspect.conftest import buses, tool

__all__ = ["buses", "tool"]
