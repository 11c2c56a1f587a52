"""``t2 health``: how the services fare, by what they tell once a second."""

import argparse
import sys
from collections.abc import Mapping

import msgspec

from cli.inspect import output
from cli.inspect.addressing import chunks
from cli.inspect.presence import present
from cli.inspect.shell import add_options, quietly, seated, wants_json
from common import codec, keys
from common.bus.probe import Probe
from common.errors import MessageError
from common.messages import Health

NEEDED = ("bridge", "safety", "odom")
LISTEN_S = 2.5  # twice what a service takes between two messages, and some
LATE_S = 0.1  # later than that a loop is held up


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Show it once; 1 when one of the robot's own services is missing or hangs."""
    with seated(options) as seat:
        told = listen(seat.probe, seat.robot)
        there = {(each.robot, each.name)
                 for each in present(seat.probe, seat.robot) if each.instance}  # fmt: skip
    robots = {robot for robot, _ in told.keys() | there} or {seat.robot}
    missing = [(r, name) for r in sorted(robots) for name in NEEDED if (r, name) not in told]
    silent = sorted((there - told.keys()) | set(missing))
    rows = [(where, told.get(where)) for where in sorted(told.keys() | set(silent))]
    if wants_json(options):
        for (robot, name), health in rows:
            output.line(as_json(robot, name, health, (robot, name) in there))
    else:
        print(as_table(rows, there))
    for robot, name in silent:
        why = "is there and tells nothing: it hangs" if (robot, name) in there else "is not there"
        print(f"t2 health: {name} of robot {robot} {why}", file=sys.stderr)
    return 1 if silent else 0


def listen(probe: Probe, robot: str) -> dict[tuple[str, str], Health]:
    """Return what each service told last, by robot and name."""
    told: dict[tuple[str, str], Health] = {}
    probe.listen(keys.HEALTH.on(robot, service="*"))
    with quietly():
        for heard in probe.samples(LISTEN_S):
            try:
                health = codec.decode(heard.payload, Health)
            except MessageError as error:
                print(f"t2 health: {heard.key}: {error}", file=sys.stderr)
            else:
                told[chunks(heard.key)[0], health.service] = health
    return told


def as_json(robot: str, name: str, health: Health | None, alive: bool) -> Mapping[str, object]:
    """Return one service for programs."""
    fields = msgspec.structs.asdict(health) if health else {}
    fields.pop("timing", None)  # `t2 latency` shows it
    return {"robot": robot, "service": name, "alive": alive, "told": bool(health)} | fields


def as_table(rows: list[tuple[tuple[str, str], Health | None]], there: set[tuple[str, str]]) -> str:
    """Return a row for each service."""
    cells = []
    for where, health in rows:
        state = "ok" if health else ("hangs" if where in there else "missing")
        cells.append([where[0], where[1], *_cells(health, state)])
    head = ["robot", "service", "", "version", "up", "late ms", "MB", "messages/s", "counters"]
    return output.table(head, cells)


def _cells(health: Health | None, state: str) -> list[str]:
    if not health:
        return [state, *[""] * 6]
    counters = " ".join(f"{name}={count}" for name, count in sorted(health.counters.items()))
    return [
        "held up" if health.lateness > LATE_S else state,
        health.version,
        up(health.uptime),
        f"{health.lateness * 1000:.1f}",
        f"{health.rss / 1e6:.0f}",
        f"{sum(health.rates.values()):.0f}",
        counters or "-",
    ]


def up(seconds: float) -> str:
    """Return how long for people."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}h{minutes:02d}m" if hours else f"{minutes}m{rest:02d}s"
