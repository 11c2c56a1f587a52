"""The folder is small, and needs Python 3.9 and its standard library alone."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from services import relay

FILES = sorted(Path(relay.__file__).parent.glob("*.py"))


def imported(tree: ast.Module) -> Iterator[str]:
    """Yield the absolute imports of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield str(node.module)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_module_is_python_3_9_and_imports_the_standard_library_only(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"), feature_version=(3, 9))
    names = {name.partition(".")[0] for name in imported(tree)}
    assert names <= sys.stdlib_module_names
