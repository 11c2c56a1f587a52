"""A router for all tests of this folder; for each test a robot id and a recordings folder."""

from tests.cli.inspect.conftest import buses, tool
from tests.recorder.files_fixture import files

__all__ = ["buses", "files", "tool"]
