"""The table of equivalent mutants: changes of the source that no test can detect.

A row of ``equivalent.toml`` names a file, a function of it (``Class.method``; a nested function
counts to the outer one), the text of a line in there, how many of its mutants are equivalent, and
why. Equal lines of one function share a row.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import msgspec
from msgspec import Struct

TABLE = Path(__file__).with_name("equivalent.toml")


class TableError(Exception):
    """A row of the table that fits no line of the source."""


class Row(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One line of the source with its equivalent mutants."""

    file: str
    function: str
    line: str
    mutants: int
    why: str

    @property
    def name(self) -> str:
        """The row in a message."""
        return f"{self.file}, {self.function}: {self.line}"


@cache
def table() -> tuple[Row, ...]:
    """Return all rows."""
    return msgspec.toml.decode(TABLE.read_bytes(), type=dict[str, tuple[Row, ...]])["equivalent"]


def check(rows: tuple[Row, ...], root: Path) -> None:
    """Raise ``TableError`` with the rows that fit no line below ``root``, or that exist twice."""
    lines = {file: _lines(root / file) for file in {row.file for row in rows}}
    wrong, seen = [], set[tuple[str, str, str]]()
    for row in rows:
        key = row.file, row.function, row.line
        if row.line not in lines[row.file].get(row.function, ()):
            wrong.append(f"no such line: {row.name}")
        if key in seen:
            wrong.append(f"twice: {row.name}")
        seen.add(key)
    if wrong:
        raise TableError("\n".join([f"{TABLE.name}:", *wrong]))


def _lines(path: Path) -> dict[str, set[str]]:
    """Return the lines of each function, without their indents; nothing without the file."""
    if not path.is_file():
        return {}
    source = path.read_text("utf-8")
    lines = [line.strip() for line in source.splitlines()]
    found: dict[str, set[str]] = {}
    for name, node in _functions(ast.parse(source)):
        found.setdefault(name, set()).update(lines[node.lineno - 1 : node.end_lineno])
    return found


def _functions(module: ast.Module) -> Iterator[tuple[str, ast.stmt]]:
    """Yield what is mutated: functions, and methods of classes."""
    for node in module.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node
        for part in node.body if isinstance(node, ast.ClassDef) else ():
            if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef):
                yield f"{node.name}.{part.name}", part  # type: ignore[attr-defined]
