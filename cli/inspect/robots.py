"""``t2 robots``: robots on the bus with services, safety verdict, speed and driver.

Liveliness tokens list the robots; safety's newest state gives the verdict.
"""

import argparse
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERY_ROBOT, chunks
from cli.inspect.estop import MOVES
from cli.inspect.session import add_options, open_session, until_interrupt
from common import codec, keys
from common.bus.probe import Probe
from common.codec import Sample
from common.errors import MessageError, RobotError
from common.messages import SafetyState, Velocity

LISTEN_S = 1.5  # at most; over a thin uplink a stream may have 1 Hz
HEAD = ("robot", "services", "verdict", "m/s", "driver", "")


@dataclass(slots=True)
class Robot:
    """One robot with its services and newest messages."""

    services: set[str] = field(default_factory=set)
    state: SafetyState | None = None
    velocity: Velocity | None = None

    @property
    def verdict(self) -> str:
        """Safety's verdict, or why it is missing."""
        if self.state:
            return self.state.verdict
        if "safety" in self.services:
            return "silent"
        return "no safety" if self.moves else "-"

    @property
    def moves(self) -> bool:
        """Whether it can move, as opposed to a laptop's service under a robot's name."""
        return not self.services.isdisjoint(MOVES)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List the robots; return 1 if one that moves has no safety state."""
    options.robot = options.robot or EVERY_ROBOT
    with open_session(options) as session:
        found = discover(session.probe, session.robot)
    if not found:
        raise RobotError("no robot found; try `t2 doctor`")
    rows = [as_json(name, found[name]) for name in sorted(found)]
    output.rows(rows, HEAD, as_cells, as_json=options.json)
    return 0 if all(each.state for each in found.values() if each.moves) else 1


def discover(probe: Probe, robot: str) -> dict[str, Robot]:
    """Return the robots by name, with the messages that arrive within the time limit."""
    found: defaultdict[str, Robot] = defaultdict(Robot)
    for topic in (keys.SAFETY, keys.VELOCITY):
        probe.listen(topic.on(robot))
    for name, path in map(chunks, probe.alive(keys.live_key(robot, "*", "*"))):
        found[name].services.add(path.split("/")[1])
    wanted = {keys.SAFETY.on(name) for name, each in found.items() if "safety" in each.services}
    wanted |= {keys.VELOCITY.on(name) for name, each in found.items() if "bridge" in each.services}
    newest: dict[str, Sample] = {}
    with until_interrupt():
        for sample in probe.samples(LISTEN_S):
            newest[sample.key] = sample
            if newest.keys() >= wanted:
                break
    for key, sample in newest.items():
        robot_of = found[chunks(key)[0]]
        try:
            if key.endswith(keys.SAFETY.path):
                robot_of.state = codec.decode(sample.payload, SafetyState)
            else:
                robot_of.velocity = codec.decode(sample.payload, Velocity)
        except MessageError as error:
            output.warn(f"t2 robots: {key}: {error}")
    return found


def as_json(name: str, robot: Robot) -> dict[str, Any]:
    """Return one robot as a JSON object; ``linear`` in m/s."""
    state = robot.state
    return {
        "robot": name,
        "services": sorted(robot.services),
        "verdict": robot.verdict,
        "latched": list(state.latched) if state else [],
        "source": state.source if state else None,
        "linear": robot.velocity.linear if robot.velocity else None,
        "text": state.text if state else "",
    }


def as_cells(row: output.Row) -> list[str]:
    """Return one robot as table cells."""
    speed = "" if row["linear"] is None else f"{row['linear']:.2f}"
    services = " ".join(row["services"])
    return [row["robot"], services, row["verdict"], speed, row["source"] or "-", row["text"]]
