"""``t2 schema``: the fields of a message type, with units; JSON schema in a pipe.

The types are those of this installation, which need not be the robot's: `t2 doctor` compares.
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
from cli.inspect.shell import add_options, settings, wants_json
from common import messages
from common.errors import RobotError
from common.keys import CALLS, TOPICS

FIELD = re.compile(r"    (?P<name>\w+): (?P<type>.+?)(?: = (?P<default>.+?))?(?:  # (?P<why>.+))?$")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "type", nargs="?", metavar="TYPE", help="such as Odometry, or a key; all types without"
    )
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Show one type, or name all; raise ``RobotError`` for one that there is not."""
    if not options.type:
        show_all(wants_json(options))
        return 0
    name = named(options.type, settings(options).robot.id)
    if wants_json(options):
        output.line(msgspec.json.schema(kinds()[name]))
        return 0
    kind = kinds()[name]
    print(f"{name}: {(kind.__doc__ or '').splitlines()[0]}\n")
    print(output.table(("field", "type", "default", ""), fields_of(kind)) or "no fields")
    return 0


def named(word: str, robot: str) -> str:
    """Return the type that is meant: by its name in any case, or by its key."""
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
    meant = f"did you mean {by_lower[near[0]]}? " if near else ""
    raise RobotError(f"there is no type {word!r}; {meant}`t2 schema` names all")


def show_all(as_json: bool) -> None:
    """Name every type and the keys that carry it."""
    carried = {
        name: [t.path for t in TOPICS if t.message is kind] for name, kind in kinds().items()
    }
    for call in CALLS:
        carried[call.request.__name__].append(call.path)
    if as_json:
        for name, paths in carried.items():
            output.line({"type": name, "keys": paths})
        return
    print(output.table(("type", "on"), [(n, ", ".join(paths)) for n, paths in carried.items()]))


def fields_of(kind: type[Struct]) -> list[tuple[str, str, str, str]]:
    """Return name, type, default and meaning of a struct's own fields, as its source tells them."""
    found = filter(None, map(FIELD.match, inspect.getsource(kind).splitlines()))
    return [
        (each["name"], spelt(each["type"]), each["default"] or "", each["why"] or "")
        for each in found
    ]


def spelt(kind: str) -> str:
    """Return a type with the words that it allows, where the source has a name for them."""
    words = getattr(messages, kind, None)
    if isinstance(words, type) and issubclass(words, StrEnum):
        return " | ".join(repr(word.value) for word in words)
    return " | ".join(map(repr, get_args(words))) if get_origin(words) is Literal else kind
