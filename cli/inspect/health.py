"""``t2 health``: service health, from the health messages at 1 Hz.

``t2 health safety`` queries one service, which answers in its own loop. The command ends with the
answer, so a container's health check can run it often.
"""

import argparse
import itertools
import sys
import time
from bisect import bisect_left
from itertools import accumulate
from typing import Any, NamedTuple

import msgspec

from cli.inspect import output
from cli.inspect.addressing import chunks, decode
from cli.inspect.services import discover
from cli.inspect.session import BusSession, add_options, open_session, until_interrupt, wants_json
from common import keys
from common.bus.probe import Answer, Probe
from common.errors import LinkError, MessageError
from common.messages import Durations, Health

NEEDED = ("bridge", "safety", "odom")
ROUTER = "router"  # not a service of ours; it is healthy if it accepts a session
LISTEN_S = 2.5  # two periods of the health messages, and a margin
ANSWER_S = 2.0  # a loop with longer stalls is unhealthy
LATE_S = 0.1  # loop lateness that is reported
PAUSE_S = 0.5  # between two rounds of --watch
CLEAR = "\x1b[H\x1b[J"  # a terminal's screen, by ECMA-48
HEAD = ("robot", "service", "", "version", "up", "late ms", "fifo", "MB", "messages/s", "counters")
REASONS = {
    "hangs": "is present and publishes no health: it hangs",
    "missing": "is not running",
    "silent": "does not answer",
    "unreadable": "answers with an invalid health message",
}


class Row(NamedTuple):
    """One service with its state and last health message."""

    robot: str
    name: str
    state: str  # ok, or a key of REASONS
    health: Health | None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "service", nargs="?", help="query this service only, such as safety, or the router"
    )
    parser.add_argument("--watch", "-w", action="store_true", help="repeat until Ctrl-C")
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Show health; return 1 if a needed or the queried service is unhealthy in the last round."""
    if not options.watch:
        return show(listened(options), in_json=wants_json(options))
    code = 0
    with until_interrupt():
        for _ in itertools.count():
            code = watched(options)
            time.sleep(PAUSE_S)
    return code


def watched(options: argparse.Namespace) -> int:
    """Show one round of ``--watch``; the router may be restarting."""
    try:
        found = listened(options)
    except LinkError as error:
        output.warn(f"t2 health: {error}")
        return 1
    if sys.stdout.isatty():
        print(CLEAR, end="")
    return show(found, in_json=wants_json(options))


def listened(options: argparse.Namespace) -> list[Row]:
    """Return the services that the options name."""
    with open_session(options) as session:
        service = options.service
        return query(session, service) if service else listen_to_all(session)


def show(found: list[Row], *, in_json: bool) -> int:
    """Print the services; return 1 if one is unhealthy."""
    if in_json:
        for row in found:
            output.line(as_json(row))
    else:
        head, *lines = output.table(HEAD, list(map(as_cells, found))).splitlines()
        painted = (output.painted(line, tone(row)) for line, row in zip(lines, found, strict=True))
        print("\n".join([head, *painted, *reaction_lines(found)]), flush=True)
    unhealthy = [row for row in found if row.state != "ok"]
    for row in unhealthy:
        output.warn(f"t2 health: {row.name} of robot {row.robot} {REASONS[row.state]}")
    return 1 if unhealthy else 0


def tone(row: Row) -> str:
    """Return the tone of a service's line."""
    if row.state != "ok":
        return "bad"
    return "note" if row.health and row.health.lateness > LATE_S else "good"


def query(session: BusSession, name: str) -> list[Row]:
    """Query one service for its last health message."""
    if name == ROUTER:
        return [Row(session.robot, name, "ok", None)]
    answers = session.probe.query(keys.info_key(session.robot, name, "last"), timeout_s=ANSWER_S)
    rows = [parse_answer(each, name) for each in answers if not each.refusal]
    return rows or [Row(session.robot, name, "silent", None)]


def parse_answer(answer: Answer, name: str) -> Row:
    """Return the row of an answer; in its first second a service has no health yet."""
    robot = chunks(answer.key)[0]
    try:
        last = msgspec.json.decode(answer.payload, type=dict[str, msgspec.Raw])
        raw = last.get(keys.HEALTH.on(robot, service=name))
        health = None if raw is None else msgspec.json.decode(raw, type=Health)
    except msgspec.DecodeError:
        return Row(robot, name, "unreadable", None)
    return Row(robot, name, "ok", health)


def listen_to_all(session: BusSession) -> list[Row]:
    """Listen to all services, and list those without a health message from their tokens."""
    newest = listen(session.probe, session.robot)
    alive = {(each.robot, each.name)
             for each in discover(session.probe, session.robot) if each.instance}  # fmt: skip
    robots = {robot for robot, _ in newest.keys() | alive} or {session.robot}
    needed = {(robot, name) for robot in robots for name in NEEDED}
    return [
        Row(*each, "ok" if each in newest else "hangs" if each in alive else "missing",
            newest.get(each))
        for each in sorted(newest.keys() | alive | needed)
    ]  # fmt: skip


def listen(probe: Probe, robot: str) -> dict[tuple[str, str], Health]:
    """Return the newest health message of each service, by robot and name."""
    newest: dict[tuple[str, str], Health] = {}
    probe.listen(keys.HEALTH.on(robot, service="*"))
    for sample in probe.samples(LISTEN_S):
        try:
            health = decode(sample, Health)
            newest[chunks(sample.key)[0], health.service] = health
        except MessageError as error:
            output.warn(f"t2 health: {sample.key}: {error}")
    return newest


def as_json(row: Row) -> dict[str, Any]:
    """Return one service as a JSON object."""
    fields = msgspec.structs.asdict(row.health) if row.health else {}
    if row.health:
        fields["reactions"] = {name: figures(each) for name, each in row.health.reactions.items()}
    alive, has_health = row.state in ("ok", "hangs"), row.health is not None
    return {"robot": row.robot, "service": row.name, "alive": alive, "told": has_health} | fields


def as_cells(row: Row) -> list[str]:
    """Return one service as table cells."""
    health = row.health
    if not health:
        return [row.robot, row.name, row.state, *[""] * 7]
    counters = " ".join(f"{name}={count}" for name, count in sorted(health.counters.items()))
    return [
        row.robot,
        row.name,
        "stalls" if health.lateness > LATE_S else row.state,
        health.version,
        duration(health.uptime),
        f"{health.lateness * 1000:.1f}",
        str(health.priority or "-"),
        f"{health.rss / 1e6:.0f}",
        f"{sum(health.rates.values()):.0f}",
        counters or "-",
    ]


def reaction_lines(found: list[Row]) -> list[str]:
    """Return a line for each reaction that was measured since its service's start."""
    return [
        f"{row.name} of robot {row.robot}: {name} measured {sum(each.counts)} times, in ms: "
        f"p50 {1e3 * quantile(each, 0.5):.2f}, p99 {1e3 * quantile(each, 0.99):.2f}, "
        f"worst {1e3 * each.worst:.2f}"
        for row in found
        if row.health
        for name, each in row.health.reactions.items()
        if any(each.counts)
    ]


def figures(durations: Durations) -> dict[str, Any]:
    """Return count, quantiles and worst in s; None without any."""
    known = any(durations.counts)
    return {
        "count": sum(durations.counts),
        "p50": quantile(durations, 0.5) if known else None,
        "p99": quantile(durations, 0.99) if known else None,
        "worst": durations.worst if known else None,
    }


def quantile(durations: Durations, part: float) -> float:
    """Return an upper bound of a quantile: the bound of its bucket, or the worst if less."""
    number = bisect_left(list(accumulate(durations.counts)), part * sum(durations.counts))
    return min([*durations.bounds[number : number + 1], durations.worst])


def duration(seconds: float) -> str:
    """Return a duration as text."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}h{minutes:02d}m" if hours else f"{minutes}m{rest:02d}s"
