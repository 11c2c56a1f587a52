"""``t2 rounds``: start, pause, resume and end rounds; their state, list and reports."""

import argparse
import re
from pathlib import Path
from typing import Any

import msgspec

from cli.inspect import output
from cli.inspect.client import SafetyClient
from cli.inspect.session import decoded, open_session
from cli.patrol import report
from cli.patrol.calls import (
    add_route,
    add_verb,
    ask,
    duration,
    fixed,
    local,
    open_client,
    show_done,
    show_rows,
)
from common.cli_args import file_path, reader_language
from common.text import printable
from t2 import keys
from t2 import messages as m
from t2.errors import T2Error
from t2.words import Language, render

STATE_S = 2.0  # wait for a state of patrol, which has 5 Hz
EMPTY = "t2 rounds: there are none; `t2 rounds start ROUTE` starts one"
ACTIONS = {
    "depart": "end the stay at a station",
    "pause": "stop until somebody resumes",
    "resume": "go on with a round that is paused or stopped",
    "return": "drive home along the route",
    "abort": "end the round where the vehicle is",
}
WITHOUT_SAFETY = ("pause", "abort")  # they stop: however late they arrive


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    add_route(add_verb(verbs, "start", "start a round; the vehicle is at home"), "ROUTE")
    for name, what in ACTIONS.items():
        add_verb(verbs, name, what)
    add_verb(verbs, "status", "show what the round does, and the next one of the schedule")
    listing = add_verb(verbs, "list", "list the rounds that are over, the newest first")
    listing.add_argument("--most", type=int, default=20, metavar="N", help="20 by default")
    page = add_verb(verbs, "report", "write an HTML report of a round, and print its path")
    page.add_argument("round", nargs="?", metavar="ID", help="by default the newest one")
    page.add_argument(
        "-o", "--out", type=file_path, metavar="FILE", help="output file; by default ID.html"
    )


def run(options: argparse.Namespace) -> int:
    """Run the subcommand."""
    if options.verb == "status":
        return show_status(options)
    with open_client(options) as client:
        if options.verb == "list":
            return show_list(client, options)
        if options.verb == "report":
            return write_report(client, options)
        fields = {"action": options.verb}
        if options.verb == "start":
            fields["route"] = options.route
        late = options.verb in WITHOUT_SAFETY
        return show_done(ask(client, keys.ROUND, late=late, **fields), options)


def show_status(options: argparse.Namespace) -> int:
    """Print the newest state of patrol."""
    with open_session(options) as session:
        session.inspector.listen(keys.PATROL.on(session.robot))
        state = next(decoded(session.inspector.samples(STATE_S), m.PatrolState), None)
        if state is None:
            raise T2Error(
                f"no state of patrol within {STATE_S:g} s: is patrol running? "
                f"run {session.inspector.doctor}"
            )
    if options.json:
        output.line(msgspec.to_builtins(state))
    else:
        output.value(status(state, reader_language()), as_json=False)
    return 0


def status(state: m.PatrolState, language: Language) -> dict[str, str]:
    """Return what a state contains, by name."""
    found = {"state": state.state, "text": render(state.phrases, language, state.text)}
    if state.round:
        found["round"] = state.round
    if state.round and state.state != "done":
        station = "" if state.state == "staying" else state.station  # its text names that one
        found |= {"progress": progress(state), "next station": station}
    if state.deviation is not None and state.sigma is not None and state.corridor is not None:
        used = state.deviation + 2 * state.sigma
        found["deviation"] = (
            f"{state.deviation:.2f} m and 2 sigma {2 * state.sigma:.2f} m are {used:.2f} m; "
            f"the corridor is {state.corridor:.2f} m"
        )
    if state.teaching is not None:
        found["teaching"] = teaching(state.teaching, language)
    if state.next is not None:
        coming = state.next
        found["next round"] = f"{coming.schedule} on {coming.route}, {local(coming.t_ns)}"
    return {name: text for name, text in found.items() if text}


def progress(state: m.PatrolState) -> str:
    """Return how far the round is."""
    if state.progress is None or state.length is None:
        return ""
    way = ", on its way home" if state.homeward else ""
    return f"{state.progress:.1f} m of {state.length:.1f} m{way}"


def teaching(state: m.Teaching, language: Language) -> str:
    """Return how far a route has been taught."""
    stations = ", ".join(state.stations)
    text = render(state.phrases, language, state.text)
    return f"{state.route}, {state.length:.1f} m, stations: {stations}. {text}".rstrip()


def show_list(client: SafetyClient, options: argparse.Namespace) -> int:
    """Print the rounds of the ledger."""
    rounds = ask(client, keys.ROUNDS, most=options.most).rounds
    if options.json:
        return show_rows([msgspec.to_builtins(each) for each in rounds], options, EMPTY)
    return show_rows([row(each) for each in rounds], options, EMPTY)


def row(found: m.Round) -> dict[str, Any]:
    """Return a round as a row of the table."""
    return {
        "round": found.id,
        "begin": local(found.start_ns),
        "time": duration(found.start_ns, found.end_ns),
        "result": found.result,
        "m": fixed(found.distance, 1),
        "stations": str(len(found.visits)),
        "halts": str(len(found.halts)),
        "deviation": fixed(found.deviation, 2),
        "margin": fixed(found.margin, 2),
        "schedule": found.schedule,
    }


def write_report(client: SafetyClient, options: argparse.Namespace) -> int:
    """Write the report of a round."""
    wanted = options.round
    if not wanted:
        newest = ask(client, keys.ROUNDS, most=1).rounds
        if not newest:
            raise T2Error("there are no rounds; `t2 rounds start ROUTE` starts one")
        wanted = newest[0].id
    reply = ask(client, keys.ROUNDS, round=wanted)
    if not reply.rounds:
        raise T2Error(f"the answer has no round {wanted}")
    name = re.sub(r"[^\w-]", "_", reply.rounds[0].id)  # of the bus, and now of a file
    out: Path = options.out or Path(f"{name}.html")
    text = printable(report.page(reply, reader_language()), "\n")
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise T2Error(f"{out}: cannot be written: {error.strerror}") from None
    print(out)
    return 0
