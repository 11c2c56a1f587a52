"""The client library stands alone: Python 3.10, Zenoh and msgspec, and nothing of the stack."""

import ast
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tools import sdk

NO_CODE = (
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE,
    tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER,
)  # fmt: skip
FILES = sorted(sdk.SDK.glob("*.py"))


def imported(tree: ast.Module) -> Iterator[str]:
    """Yield the names of the imported packages."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            yield str(node.module).partition(".")[0]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_module_is_python_3_10_and_imports_nothing_of_the_stack(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"), feature_version=(3, 10))
    allowed = {*sys.stdlib_module_names, "msgspec", "t2", "zenoh"}
    if file.name == "pytest_plugin.py":  # pytest loads it
        allowed.add("pytest")
    assert set(imported(tree)) <= allowed


def test_hand_written_code_is_short() -> None:
    written = [file for file in FILES if file not in sdk.generated()]
    assert sum(len(code_lines(file)) for file in written) < 990


def code_lines(file: Path) -> set[int]:
    """Return the numbers of the lines with code: no blank line, comment or docstring."""
    docstrings, code = set[int](), set[int]()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            docstrings.update(range(node.lineno, (node.end_lineno or 0) + 1))
    with tokenize.open(file) as text:
        for token in tokenize.generate_tokens(text.readline):
            if token.type not in NO_CODE:
                code.update(range(token.start[0], token.end[0] + 1))
    return code - docstrings


def test_generated_modules_are_current() -> None:
    for file, text in sdk.generated().items():
        assert file.read_text(encoding="utf-8") == text, f"{file.name}: run `make docs`"
