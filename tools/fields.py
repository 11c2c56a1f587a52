"""Fields of a struct with the comments of its source code, for the generated documents."""

import inspect
import re
from collections.abc import Iterator
from enum import StrEnum
from typing import Literal, NamedTuple, get_args, get_origin

from msgspec import Struct

from t2 import messages

FIELD = re.compile(
    r"    (?P<name>\w+): (?:Annotated\[(?=.+, (?:Few|Many)\]))?(?P<type>.+?)(?:, (?:Few|Many)\])?"
    r"(?: = (?P<default>.+?))?(?:  # (?P<why>.+))?$"
)


class Field(NamedTuple):
    """One field, as its source code has it."""

    name: str
    type: str
    default: str
    why: str  # the comments above it and of its line


def fields_of(kind: type[Struct]) -> Iterator[Field]:
    """Yield the own fields of a struct."""
    above: list[str] = []
    for line in inspect.getsource(kind).splitlines():
        if line.startswith("    # "):
            above.append(line.removeprefix("    # "))
            continue
        if field := FIELD.match(line):
            why = " ".join([*above, field["why"] or ""]).strip()
            yield Field(field["name"], literals(field["type"]), field["default"] or "", why)
        above = []


def literals(kind: str) -> str:
    """Return a type with its literal values, where the source names a Literal."""
    words = getattr(messages, kind, None)
    if isinstance(words, type) and issubclass(words, StrEnum):
        return " | ".join(repr(word.value) for word in words)
    return " | ".join(map(repr, get_args(words))) if get_origin(words) is Literal else kind
