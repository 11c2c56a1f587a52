"""``t2 schema``: fields of a message type with units; with ``--json`` its JSON schema.

The types are those of this installation; `t2 doctor` compares it with the robot's version.
"""

import argparse
import difflib
import inspect
import re
from enum import StrEnum
from typing import Literal, get_args, get_origin

import msgspec
from msgspec import Struct

from cli.inspect import output
from cli.inspect.addressing import expression, topic_of
from cli.inspect.payload import kinds
from cli.inspect.session import add_options, settings
from common import messages
from common.errors import RobotError
from common.keys import CALLS, TOPICS

FIELD = re.compile(
    r"    (?P<name>\w+): (?:Annotated\[(?=.+, Few\]))?(?P<type>.+?)(?:, Few\])?"
    r"(?: = (?P<default>.+?))?(?:  # (?P<why>.+))?$"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "type", nargs="?", metavar="TYPE", help="such as Odometry, or a key; all types if omitted"
    )
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Show one type, or list all; raise ``RobotError`` for an unknown type."""
    if not options.type:
        rows = [{"type": name, "keys": paths} for name, paths in keys_by_type().items()]
        output.rows(
            rows, ("type", "on"), lambda row: [row["type"], ", ".join(row["keys"])], options.output
        )
        return 0
    name = find_type(options.type, settings(options).robot.id)
    kind = kinds()[name]
    if options.output == "json":
        output.line(msgspec.json.schema(kind))
        return 0
    print(f"{name}: {(kind.__doc__ or '').splitlines()[0]}\n")
    print(output.table(("field", "type", "default", ""), fields_of(kind)) or "no fields")
    return 0


def find_type(word: str, robot: str) -> str:
    """Return the type for a type's name in any case, or for a key."""
    by_lower = {name.lower(): name for name in kinds()}
    if word.lower() in by_lower:
        return by_lower[word.lower()]
    for call in CALLS:
        if word.strip("/") in (call.path, call.path.removeprefix("srv/")):
            return call.request.__name__
    topic = topic_of(expression(word, robot))
    if topic:
        return topic.message.__name__
    near = difflib.get_close_matches(word.lower(), by_lower, n=1)
    hint = f"did you mean {by_lower[near[0]]}? " if near else ""
    raise RobotError(f"unknown type {word!r}; {hint}`t2 schema` lists all types")


def keys_by_type() -> dict[str, list[str]]:
    """Return each type with the keys that carry it."""
    paths = {name: [t.path for t in TOPICS if t.message is kind] for name, kind in kinds().items()}
    for call in CALLS:
        paths[call.request.__name__].append(call.path)
    return paths


def fields_of(kind: type[Struct]) -> list[tuple[str, str, str, str]]:
    """Return name, type, default and comment of a struct's own fields, from its source code."""
    found = filter(None, map(FIELD.match, inspect.getsource(kind).splitlines()))
    return [
        (each["name"], literals(each["type"]), each["default"] or "", each["why"] or "")
        for each in found
    ]


def literals(kind: str) -> str:
    """Return a type with its literal values, where the source names a Literal."""
    words = getattr(messages, kind, None)
    if isinstance(words, type) and issubclass(words, StrEnum):
        return " | ".join(repr(word.value) for word in words)
    return " | ".join(map(repr, get_args(words))) if get_origin(words) is Literal else kind
