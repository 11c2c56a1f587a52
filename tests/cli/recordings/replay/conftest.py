"""A router for all these tests, and a robot on it for each."""

from tests.cli.inspect.conftest import rig, shared_router, tool

__all__ = ["rig", "shared_router", "tool"]
