"""What is shown: aligned text for people, a line of JSON for programs. Needs no library."""

import sys
from collections.abc import Sequence
from typing import Any

import msgspec


def line(thing: object) -> None:
    """Print one JSON line; what is no number becomes null, and bytes hexadecimal."""
    sys.stdout.write(json(thing) + "\n")
    sys.stdout.flush()


def json(thing: object) -> str:
    """Return it as JSON on one line; what is no number becomes null, and bytes hexadecimal."""
    return msgspec.json.encode(plain(thing)).decode()


def plain(thing: Any) -> Any:
    """Return it in what JSON has: keys are text, bytes are hexadecimal."""
    match thing:
        case dict():
            return {str(plain(key)): plain(value) for key, value in thing.items()}
        case list() | tuple():
            return [plain(each) for each in thing]
        case bytes():
            return thing.hex()
        case None | bool() | int() | float() | str():
            return thing
        case _:
            return str(thing)


def printable(text: str) -> str:
    """Return a text from the bus without what a terminal would obey."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return aligned columns; those that hold numbers alone stand to the right."""
    rows = [[printable(cell) for cell in row] for row in rows]
    columns = list(zip(head, *rows, strict=True))
    wide = [max(map(len, column)) for column in columns]
    right = [bool(rows) and all(map(_is_number, column[1:])) for column in columns]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(row, wide, right, strict=True)
        ).rstrip()
        for row in (head, *rows)
    )


def fields(value: Any, indent: str = "") -> str:
    """Return a value as lines ``name: value``, nested ones below and indented."""
    if isinstance(value, dict) and value:
        return "\n".join(_field(f"{indent}{name}:", each, indent) for name, each in value.items())
    if isinstance(value, list) and value:
        return "\n".join(_field(f"{indent}-", each, indent) for each in value)
    return f"{indent}{scalar(value)}"


def scalar(value: Any) -> str:
    """Return a single value for people: six digits are enough of a number."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, str) and value:
        return printable(value)
    return msgspec.json.encode(plain(value)).decode()


def _field(name: str, value: Any, indent: str) -> str:
    if isinstance(value, list) and not any(isinstance(each, dict | list) for each in value):
        return f"{name} [{', '.join(map(scalar, value))}]"
    if isinstance(value, dict | list) and value:
        return f"{name}\n{fields(value, indent + '  ')}"
    return f"{name} {scalar(value)}"


def _is_number(cell: str) -> bool:
    return not cell.strip("-+.,0123456789e")
