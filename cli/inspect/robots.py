"""``t2 robots``: the robots that are there: services, verdict, speed, and who drives.

Who is there is known by liveliness, how it fares by safety's newest word.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERY_ROBOT, chunks
from cli.inspect.estop import MOVES
from cli.inspect.shell import add_options, quietly, seated, wants_json
from common import codec, keys
from common.bus.probe import Probe
from common.errors import MessageError
from common.messages import SafetyState, Velocity
from common.sample import Sample

LISTEN_S = 1.5  # at most; over a thin uplink a stream may come once a second
SILENT = "silent"  # safety is there and tells nothing


@dataclass(slots=True)
class Found:
    """What is known of one robot."""

    services: set[str] = field(default_factory=set)
    state: SafetyState | None = None
    velocity: Velocity | None = None

    @property
    def verdict(self) -> str:
        """Safety's, or why there is none."""
        if self.state:
            return self.state.verdict
        if "safety" in self.services:
            return SILENT
        return "no safety" if self.moves else "-"

    @property
    def moves(self) -> bool:
        """Whether it is more than a laptop's service under a robot's name."""
        return not self.services.isdisjoint(MOVES)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List them; 1 when nobody is there, or safety of one is missing or tells nothing."""
    options.robot = options.robot or EVERY_ROBOT
    with seated(options) as seat:
        found = look(seat.probe, seat.robot)
    if not found:
        print("t2 robots: nobody is there; try `t2 doctor`", file=sys.stderr)
        return 1
    rows = [as_json(name, found[name]) for name in sorted(found)]
    if wants_json(options):
        for row in rows:
            output.line(row)
    else:
        head = ["robot", "services", "verdict", "m/s", "driver", ""]
        print(output.table(head, [as_cells(row) for row in rows]))
    return 0 if all(each.state for each in found.values() if each.moves) else 1


def look(probe: Probe, robot: str) -> dict[str, Found]:
    """Return the robots by name; waits until each has told, and not for long."""
    found: defaultdict[str, Found] = defaultdict(Found)
    for topic in (keys.SAFETY, keys.VELOCITY):
        probe.listen(topic.on(robot))
    for name, path in map(chunks, probe.alive(keys.live_key(robot, "*", "*"))):
        found[name].services.add(path.split("/")[1])
    for key, heard in newest(probe, expected(found)).items():
        note(found[chunks(key)[0]], heard)
    return found


def expected(found: Mapping[str, Found]) -> set[str]:
    """Return the keys that tell, of those who are there."""
    safe = {keys.SAFETY.on(name) for name, each in found.items() if "safety" in each.services}
    return safe | {keys.VELOCITY.on(name) for name in found if "bridge" in found[name].services}


def newest(probe: Probe, wanted: set[str]) -> dict[str, Sample]:
    """Return the newest sample of each key, once all that are wanted have come."""
    came: dict[str, Sample] = {}
    with quietly():
        for heard in probe.samples(LISTEN_S):
            came[heard.key] = heard
            if came.keys() >= wanted:
                break
    return came


def note(found: Found, heard: Sample) -> None:
    """Take in what came; what is no such message tells nothing."""
    try:
        if heard.key.endswith(keys.SAFETY.path):
            found.state = codec.decode(heard.payload, SafetyState)
        else:
            found.velocity = codec.decode(heard.payload, Velocity)
    except MessageError as error:
        print(f"t2 robots: {heard.key}: {error}", file=sys.stderr)


def as_json(name: str, found: Found) -> dict[str, Any]:
    """Return one robot for programs; ``linear`` in m/s."""
    state = found.state
    return {
        "robot": name,
        "services": sorted(found.services),
        "verdict": found.verdict,
        "latched": list(state.latched) if state else [],
        "source": state.source if state else None,
        "linear": found.velocity.linear if found.velocity else None,
        "text": state.text if state else "",
    }


def as_cells(row: Mapping[str, Any]) -> list[str]:
    """Return one robot for people."""
    speed = "" if row["linear"] is None else f"{row['linear']:.2f}"
    services = " ".join(row["services"])
    return [
        row["robot"], services, row["verdict"], speed, row["source"] or "-",
        row["text"],
    ]  # fmt: skip
