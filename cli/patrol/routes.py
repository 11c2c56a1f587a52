"""``t2 routes``: teach routes by driving, show, change and delete them.

``t2 routes show NAME > FILE``, an editor and ``t2 routes save FILE`` change a route.
"""

import argparse
import re
from pathlib import Path
from typing import Any

import msgspec

from cli.inspect import output
from cli.inspect.client import SafetyClient
from cli.patrol.calls import (
    add_route,
    add_verb,
    ask,
    fixed,
    open_client,
    show_done,
    show_rows,
    station_name,
)
from common.cli_args import file_path, reader_language
from services.patrol.core.routes import problem
from services.patrol.store import route_text
from t2 import keys
from t2 import messages as m
from t2.errors import T2Error
from t2.text_file import read_text
from t2.words import render

FIELDS = "correct it, and save again (its fields: docs/bus.md#route)"
EMPTY = "t2 routes: there are none; `t2 routes teach NAME --station HOME` teaches one"
POSITION = re.compile(r"\(byte (\d+)\)")  # in an error of msgspec


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    add_verb(verbs, "list", "list the routes; one that cannot be driven has a problem")
    add_route(add_verb(verbs, "show", "print a route as JSON, for a file"))
    teach = add_verb(verbs, "teach", "begin to teach a route where the vehicle is: its home")
    add_route(teach)
    home = "name of the first station, home"
    teach.add_argument("--station", required=True, type=station_name, metavar="HOME", help=home)
    station = add_verb(verbs, "station", "mark a station of the route where the vehicle is")
    station.add_argument("station", type=station_name, metavar="NAME", help="its name")
    for verb in (teach, station):
        verb.add_argument(
            "--stay", type=float, default=0.0, metavar="S", help="seconds that a round stays there"
        )
    add_verb(verbs, "end", "end teaching, and save the route")
    add_verb(verbs, "cancel", "end teaching without a route")
    save = add_verb(verbs, "save", "save a route from a file; it replaces the one of its name")
    save.add_argument("file", type=file_path, metavar="FILE", help="JSON, as `show` prints it")
    add_route(add_verb(verbs, "delete", "delete a route"))


def run(options: argparse.Namespace) -> int:
    """Run the subcommand."""
    route = read_route(options.file) if options.verb == "save" else None  # before anything is sent
    with open_client(options) as client:
        if options.verb == "list":
            return show_list(client, options)
        if options.verb == "show":
            return show(client, options)
        return show_done(ask(client, keys.TEACH, **request(options, route)), options)


def show_list(client: SafetyClient, options: argparse.Namespace) -> int:
    """Print the routes."""
    routes = ask(client, keys.ROUTES).routes
    if options.json:
        return show_rows([msgspec.to_builtins(each) for each in routes], options, EMPTY)
    language = reader_language()
    rows = [
        {
            "route": each.name,
            "m": fixed(each.length, 1),
            "stations": list(each.stations),
            "problem": render(each.phrases, language, each.problem),
        }
        for each in routes
    ]
    return show_rows(rows, options, EMPTY)


def show(client: SafetyClient, options: argparse.Namespace) -> int:
    """Print a route as its file has it."""
    route = ask(client, keys.ROUTES, route=options.route).route
    if route is None:
        raise T2Error(f"the answer has no route {options.route}")
    output.text(route_text(route).decode().rstrip())
    return 0


def request(options: argparse.Namespace, route: m.Route | None) -> dict[str, Any]:
    """Return the fields of a request to teach or to change."""
    names = {"teach": ("route", "station", "stay"), "station": ("station", "stay")}
    names |= {"delete": ("route",)}
    fields = {name: getattr(options, name) for name in names.get(options.verb, ())}
    if route is not None:
        fields["points"] = msgspec.to_builtins(route)
    return {"action": "begin" if options.verb == "teach" else options.verb, **fields}


def read_route(file: Path) -> m.Route:
    """Read a route; raise ``T2Error`` with the reason if it cannot be driven."""
    try:
        text = read_text(file)
    except OSError as error:
        raise T2Error(f"{file}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise T2Error(f"{file}: {error}") from None
    try:
        route = msgspec.json.decode(text, type=m.Route)
    except msgspec.DecodeError as error:
        raise T2Error(f"{file}: {with_line(str(error), text)}; {FIELDS}") from None
    if phrase := problem(route):
        raise T2Error(f"{file}: {render([phrase], reader_language())}")
    return route


def with_line(error: str, text: str) -> str:
    """Return an error of msgspec with the number of the line instead of that of the byte."""

    def line(found: "re.Match[str]") -> str:
        before = text.encode()[: int(found[1])]
        return f"(line {before.count(10) + 1})"

    return POSITION.sub(line, error)
