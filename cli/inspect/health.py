"""``t2 health``: service health, from the health messages at 1 Hz.

``t2 health safety`` ends with the next message of one service, so a container's health check can
run it often.
"""

import argparse
from typing import Any

import msgspec

from cli.inspect import output
from cli.inspect.addressing import chunks, decode
from cli.inspect.session import BusSession, add_options, open_session, services
from t2 import keys
from t2.errors import MessageError
from t2.messages import Health

ROUTER = "router"  # not a service of ours; it is healthy if it accepts a session
LISTEN_S = 2.5  # two periods of the health messages, and a margin
SHOWN = (
    "robot", "service", "state", "version", "uptime", "lateness", "priority", "rss", "counters",
)  # fmt: skip
REASONS = {"hangs": "is present and publishes no health: it hangs", "missing": "is not running"}


Row = dict[str, Any]  # robot, service, state (ok, or a key of REASONS), fields of the message


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "service", nargs="?", help="this service only, such as safety, or the router"
    )
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Show health; return 1 if a needed or the queried service is unhealthy."""
    with open_session(options) as session:
        if options.service == ROUTER:
            rows = [{"robot": session.robot, "service": ROUTER, "state": "ok"}]
        else:
            rows = listen(session, options.service)
    output.rows(rows if options.json else list(map(shown, rows)), as_json=options.json)
    unhealthy = [row for row in rows if row["state"] != "ok"]
    for row in unhealthy:
        reason = REASONS[row["state"]]
        output.warn(f"t2 health: {row['service']} of robot {row['robot']} {reason}")
    return 1 if unhealthy else 0


def shown(row: Row) -> Row:
    """Return the columns of a row, with the worst of each reaction that was measured."""
    reactions = row.get("reactions", {})
    worst = {name: each["worst"] for name, each in reactions.items() if any(each["counts"])}
    return {name: row.get(name) for name in SHOWN} | {"worst_reactions": worst}


def listen(session: BusSession, service: str | None) -> list[Row]:
    """Listen to one or all services, and list those without a health message from their tokens."""
    newest: dict[tuple[str, str], Row] = {}
    session.inspector.listen(keys.HEALTH.on(session.robot, service=service or "*"))
    for sample in session.inspector.samples(LISTEN_S):
        try:
            health = decode(sample, Health)
            newest[chunks(sample.key)[0], health.service] = msgspec.to_builtins(health)
        except MessageError as error:
            output.warn(f"t2 health: {sample.key}: {error}")
        if (session.robot, service) in newest:
            break
    alive = {*services(session.inspector, session.robot, service or "*")}
    found = {robot for robot, name in newest.keys() | alive if name in keys.ON_BOARD}
    robots = found or {session.robot}
    needed = {
        (robot, name) for robot in robots for name in ([service] if service else keys.ON_BOARD)
    }
    return [
        {
            "robot": each[0],
            "service": each[1],
            "state": "ok" if each in newest else "hangs" if each in alive else "missing",
            **newest.get(each, {}),
        }
        for each in sorted(newest.keys() | alive | needed)
    ]
