"""Rendering of command output: aligned text for people, JSON lines for programs.

Every table, value and JSON line of the inspection commands is printed here.
"""

import sys
import unicodedata
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from common.text import printable

SHOWN_BYTES = 64  # of a binary value, as text; JSON contains all


def line(thing: object) -> None:
    """Print one JSON line."""
    sys.stdout.write(json(thing) + "\n")
    sys.stdout.flush()


def warn(text: str) -> None:
    """Print a line to standard error."""
    print(printable(text, "\n"), file=sys.stderr)


def text(words: str) -> None:
    """Print a text of the bus."""
    print(printable(words, "\n"), flush=True)


def value(thing: Any, *, as_json: bool) -> None:
    """Print a value as one JSON line, or as lines ``name: value``."""
    line(thing) if as_json else text(fields(thing))


def rows(things: Sequence[Mapping[str, Any]], *, as_json: bool) -> None:
    """Print one JSON line per row, or a table with a column for each field."""
    if as_json:
        for each in things:
            line(each)
    else:
        print(table(list(things[0]), [list(map(cell, each.values())) for each in things]))
        sys.stdout.flush()


def cell(thing: Any) -> str:
    """Return a value as a table cell; "-" is none."""
    if isinstance(thing, list):
        return ", ".join(thing) or "-"
    if isinstance(thing, dict):
        return " ".join(f"{name}={cell(each)}" for name, each in sorted(thing.items())) or "-"
    if isinstance(thing, float):
        return f"{round(thing, 4):.6g}"
    return str(thing) if thing not in (None, "") else "-"


def json(thing: object) -> str:
    """Return one line of JSON; NaN and infinity become null, bytes become hexadecimal."""
    return printable(msgspec.json.encode(plain(thing)).decode())


def plain(thing: Any) -> Any:
    """Return a value made of JSON types only: keys are text, bytes are hexadecimal."""
    match thing:
        case dict():
            return {str(plain(key)): plain(each) for key, each in thing.items()}
        case list() | tuple():
            return [plain(each) for each in thing]
        case bytes():
            return thing.hex()
        case None | bool() | int() | float() | str():
            return thing
        case _:
            return str(thing)


def width(text: str) -> int:
    """Return the columns of a terminal that a text takes: a Chinese character takes two."""
    return len(text) + sum(unicodedata.east_asian_width(char) in "WF" for char in text)


def padded(text: str, columns: int) -> str:
    """Return a text in so many columns of a terminal."""
    return text + " " * (columns - width(text))


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return aligned columns; columns with only numbers are right-aligned."""
    body = [[printable(cell) for cell in row] for row in body]
    columns = list(zip(head, *body, strict=True))
    widths = [max(map(width, column)) for column in columns]
    right = [
        bool(body) and not any(cell.strip("-+.,0123456789e") for cell in column[1:])
        for column in columns
    ]
    return "\n".join(
        "  ".join(
            cell.rjust(size) if to_right else padded(cell, size)
            for cell, size, to_right in zip(row, widths, right, strict=True)
        ).rstrip()
        for row in (head, *body)
    )


def fields(thing: Any, indent: str = "") -> str:
    """Return a value as lines ``name: value``; nested values are indented below."""
    if isinstance(thing, dict) and thing:
        return "\n".join(_field(f"{indent}{name}:", each, indent) for name, each in thing.items())
    if isinstance(thing, list) and thing:
        return "\n".join(_field(f"{indent}-", each, indent) for each in thing)
    return f"{indent}{scalar(thing)}"


def scalar(thing: Any) -> str:
    """Return a single value as text; floats have six significant digits."""
    if isinstance(thing, float):
        return f"{thing:.6g}"
    if isinstance(thing, bytes):
        rest = f"... ({len(thing)} bytes)" if len(thing) > SHOWN_BYTES else ""
        return thing[:SHOWN_BYTES].hex() + rest
    if isinstance(thing, str) and thing:
        return printable(thing)
    return json(thing)


def _field(name: str, thing: Any, indent: str) -> str:
    if isinstance(thing, list) and not any(isinstance(each, dict | list) for each in thing):
        return f"{name} [{', '.join(map(scalar, thing))}]"
    if isinstance(thing, dict | list) and thing:
        return f"{name}\n{fields(thing, indent + '  ')}"
    return f"{name} {scalar(thing)}"
