"""``t2 health``: how the services fare, by what they tell once a second.

``t2 health safety`` asks one of them itself: the answer is made in its own loop. It takes no longer
than the answer does, so that a container's health check can ask often.
"""

import argparse
import sys
from collections.abc import Mapping
from typing import NamedTuple

import msgspec

from cli.inspect import output
from cli.inspect.addressing import PRETENDS, chunks, speaker
from cli.inspect.discovery import present
from cli.inspect.shell import Seat, add_options, quietly, seated, wants_json
from common import codec, keys
from common.bus.probe import Answer, Probe
from common.errors import MessageError
from common.messages import Health

NEEDED = ("bridge", "safety", "odom")
ROUTER = "router"  # is no service of ours: that it lets a session in is its answer
LISTEN_S = 2.5  # twice what a service takes between two messages, and some
ANSWER_S = 2.0  # a loop that is held up for longer does not fare well
LATE_S = 0.1  # later than that a loop is held up
WHY = {
    "hangs": "is there and tells nothing: it hangs",
    "missing": "is not there",
    "silent": "does not answer",
    "unreadable": "answers what is no health",
}


class Row(NamedTuple):
    """What is known of one service."""

    robot: str
    name: str
    state: str  # ok, or why it is not
    health: Health | None  # what it told last


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "service", nargs="?", help="ask this one alone, such as safety, or the router"
    )
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Show it once; 1 when one of the robot's own services, or the one asked, does not fare."""
    with seated(options) as seat:
        rows = one(seat, options.service) if options.service else every(seat)
    if wants_json(options):
        for row in rows:
            output.line(as_json(row))
    else:
        print(as_table(rows))
    silent = [row for row in rows if row.state != "ok"]
    for row in silent:
        print(f"t2 health: {row.name} of robot {row.robot} {WHY[row.state]}", file=sys.stderr)
    return 1 if silent else 0


def one(seat: Seat, name: str) -> list[Row]:
    """Ask one service for the last that it told of itself."""
    if name == ROUTER:
        return [Row(seat.robot, name, "ok", None)]
    answers = seat.probe.ask(keys.info_key(seat.robot, name, "last"), timeout_s=ANSWER_S)
    rows = [told_last(each, name) for each in answers if not each.refusal]
    return rows or [Row(seat.robot, name, "silent", None)]


def told_last(answer: Answer, name: str) -> Row:
    """Return what a service's own answer tells; in its first second it has no health yet."""
    robot = chunks(answer.key)[0]
    try:
        told = msgspec.json.decode(answer.payload, type=dict[str, msgspec.Raw])
        health = told.get(keys.HEALTH.on(robot, service=name))
        said = None if health is None else msgspec.json.decode(health, type=Health)
    except msgspec.DecodeError:
        return Row(robot, name, "unreadable", None)
    return Row(robot, name, "ok", said)


def every(seat: Seat) -> list[Row]:
    """Listen to all of them, and look who is there besides."""
    told = listen(seat.probe, seat.robot)
    there = {(each.robot, each.name)
             for each in present(seat.probe, seat.robot) if each.instance}  # fmt: skip
    robots = {robot for robot, _ in told.keys() | there} or {seat.robot}
    needed = {(robot, name) for robot in robots for name in NEEDED}
    return [
        Row(*where, "ok" if where in told else "hangs" if where in there else "missing",
            told.get(where))
        for where in sorted(told.keys() | there | needed)
    ]  # fmt: skip


def listen(probe: Probe, robot: str) -> dict[tuple[str, str], Health]:
    """Return what each service told last, by robot and name."""
    told: dict[tuple[str, str], Health] = {}
    probe.listen(keys.HEALTH.on(robot, service="*"))
    with quietly():
        for heard in probe.samples(LISTEN_S):
            try:
                health, name = codec.decode(heard.payload, Health), speaker(heard.key)
            except MessageError as error:
                print(f"t2 health: {heard.key}: {error}", file=sys.stderr)
                continue
            if health.service == name:
                told[chunks(heard.key)[0], name] = health
            else:
                print(f"t2 health: {heard.key}: {PRETENDS}", file=sys.stderr)
    return told


def as_json(row: Row) -> Mapping[str, object]:
    """Return one service for programs."""
    fields = msgspec.structs.asdict(row.health) if row.health else {}
    fields.pop("timing", None)  # `t2 latency` shows it
    alive, told = row.state in ("ok", "hangs"), row.health is not None
    return {"robot": row.robot, "service": row.name, "alive": alive, "told": told} | fields


def as_table(rows: list[Row]) -> str:
    """Return a row for each service."""
    cells = [[row.robot, row.name, *_cells(row)] for row in rows]
    head = ["robot", "service", "", "version", "up", "late ms", "fifo", "MB", "messages/s"]
    return output.table([*head, "counters"], cells)


def _cells(row: Row) -> list[str]:
    health = row.health
    if not health:
        return [row.state, *[""] * 7]
    counters = " ".join(f"{name}={count}" for name, count in sorted(health.counters.items()))
    return [
        "held up" if health.lateness > LATE_S else row.state,
        health.version,
        up(health.uptime),
        f"{health.lateness * 1000:.1f}",
        str(health.priority or "-"),
        f"{health.rss / 1e6:.0f}",
        f"{sum(health.rates.values()):.0f}",
        counters or "-",
    ]


def up(seconds: float) -> str:
    """Return how long for people."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}h{minutes:02d}m" if hours else f"{minutes}m{rest:02d}s"
