"""The version stands in two places, and is one."""

import tomllib
from pathlib import Path

from common.cli_args import VERSION

PROJECT = Path(__file__).parents[2] / "pyproject.toml"


def test_it_is_that_of_the_package() -> None:
    assert tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["version"] == VERSION
