"""The client library stands alone: Python 3.10, Zenoh and msgspec, and nothing of the stack."""

import ast
import sys
from collections.abc import Iterator

from tools import sdk


def imported(tree: ast.Module) -> Iterator[str]:
    """Yield the names of the imported packages."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield str(node.module).partition(".")[0]


def test_it_is_python_3_10_and_imports_nothing_of_the_stack() -> None:
    allowed = {*sys.stdlib_module_names, "msgspec", "t2", "zenoh", "pytest"}
    for file in sdk.SDK.glob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"), feature_version=(3, 10))
        assert set(imported(tree)) <= allowed, file
