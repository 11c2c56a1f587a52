"""Calls of patrol, as the commands make them."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from cli.inspect import output
from cli.inspect.client import SafetyClient
from cli.inspect.session import add_options, decoded, open_session
from common.cli_args import reader_language
from common.freshness import NS_PER_S
from t2 import messages as m
from t2.errors import T2Error
from t2.keys import Call
from t2.words import render

ReplyT = TypeVar("ReplyT", bound=Struct)
Verbs = Any  # what ``argparse`` returns for subcommands, whose class is private


def add_verb(verbs: Verbs, name: str, what: str) -> argparse.ArgumentParser:
    """Add a subcommand with the options of every command on the bus."""
    parser: argparse.ArgumentParser = verbs.add_parser(name, help=what, description=what)
    add_options(parser, every=False)
    return parser


def add_route(parser: argparse.ArgumentParser, metavar: str = "NAME") -> None:
    """Add the argument for the name of a route."""
    parser.add_argument("route", type=route_name, metavar=metavar, help="the route")


@contextmanager
def open_client(options: argparse.Namespace) -> Iterator[SafetyClient]:
    """Open a bus session for the context, with refusals in the reader's language."""
    with open_session(options) as session:
        yield SafetyClient(session.inspector, session.robot, language=reader_language())


def ask(
    client: SafetyClient, call: Call[Any, ReplyT], *, late: bool = False, **fields: Any
) -> ReplyT:
    """Return the reply to a call; raise ``T2Error`` if it is refused or not answered.

    ``late`` is for a call that works without safety, and however late it arrives.
    """
    if "echo" in call.request.__struct_fields__ and not late:
        fields["echo"] = client.fresh_state().heartbeat
    try:
        request = msgspec.convert(fields, call.request)
    except msgspec.ValidationError as error:
        raise T2Error(f"{error}; nothing was sent") from None
    for reply in decoded(client.call(call, request), call.reply):
        return reply
    raise T2Error(
        f"the answer cannot be read: is {call.server} of this version? {client.inspector.doctor}"
    )


def show_done(done: m.Done, options: argparse.Namespace) -> int:
    """Print the answer to a call that was carried out."""
    if options.json:
        output.line(msgspec.to_builtins(done))
    else:
        output.text(render(done.phrases, reader_language(), done.text))
    return 0


def show_rows(rows: list[dict[str, Any]], options: argparse.Namespace, otherwise: str) -> int:
    """Print a table, or ``otherwise`` if it is empty."""
    if rows or options.json:
        output.rows(rows, as_json=options.json)
    else:
        output.warn(otherwise)
    return 0


def fixed(number: float | None, digits: int) -> str:
    """Return a number as a table cell."""
    return "" if number is None else f"{number:.{digits}f}"


def local(wall_ns: int) -> str:
    """Return a time of the robot's wall clock in the time zone of this computer."""
    try:
        return f"{datetime.fromtimestamp(wall_ns / NS_PER_S, UTC).astimezone():%Y-%m-%d %H:%M:%S}"
    except (ValueError, OverflowError, OSError):  # any program may send any number
        return ""


def duration(begin_ns: int, end_ns: int) -> str:
    """Return the time between two times as a table cell."""
    seconds = max(0, round((end_ns - begin_ns) / NS_PER_S))
    return f"{seconds // 60}:{seconds % 60:02}"


def parsed(kind: Any, what: str) -> Callable[[str], str]:
    """Return a parser of an argument that the messages restrict."""

    def parse(text: str) -> str:
        try:
            found: str = msgspec.convert(text, kind)
        except msgspec.ValidationError:
            raise argparse.ArgumentTypeError(f"{text!r} is no {what}") from None
        return found

    return parse


route_name = parsed(
    m.RouteName,
    "name of a route: use letters and digits of any script, - and _, 32 characters at most",
)
station_name = parsed(
    m.StationName,
    "name of a station: use letters and digits of any script, spaces, - and _, 32 characters at "
    "most",
)
