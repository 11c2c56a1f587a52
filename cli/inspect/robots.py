"""``t2 robots``: robots on the bus with services, safety verdict, speed and driver.

Liveliness tokens list the robots; safety's newest state gives the verdict.
"""

import argparse
from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERY_ROBOT
from cli.inspect.estop import MOVES
from cli.inspect.session import add_options, decoded, open_session, services, until_interrupt
from common import keys
from common.bus.probe import Probe
from common.codec import Sample
from common.errors import RobotError
from common.messages import SafetyState, Velocity

LISTEN_S = 1.5  # at most; over a thin uplink a stream may have 1 Hz


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List the robots; return 1 if one that moves has no safety state."""
    options.robot = options.robot or EVERY_ROBOT
    with open_session(options) as session:
        found, newest = discover(session.probe, session.robot)
    if not found:
        raise RobotError("no robot found; try `t2 doctor`")
    rows = [row(name, found[name], newest) for name in sorted(found)]
    output.rows(rows, as_json=options.json)
    return 1 if {"silent", "no safety"} & {each["verdict"] for each in rows} else 0


def discover(probe: Probe, robot: str) -> tuple[dict[str, set[str]], dict[str, Sample]]:
    """Return the services of each robot, and the newest message by key within the time limit."""
    for topic in (keys.SAFETY, keys.VELOCITY):
        probe.listen(topic.on(robot))
    found: defaultdict[str, set[str]] = defaultdict(set)
    for name, service in services(probe, robot):
        found[name].add(service)
    wanted = {keys.SAFETY.on(name) for name, has in found.items() if "safety" in has}
    wanted |= {keys.VELOCITY.on(name) for name, has in found.items() if "bridge" in has}
    newest: dict[str, Sample] = {}
    with until_interrupt():
        for sample in probe.samples(LISTEN_S):
            newest[sample.key] = sample
            if newest.keys() >= wanted:
                break
    return found, newest


def row(name: str, services: set[str], newest: Mapping[str, Sample]) -> dict[str, Any]:
    """Return one robot as a JSON object; ``linear`` in m/s."""
    states = decoded(filter(None, [newest.get(keys.SAFETY.on(name))]), SafetyState)
    velocities = decoded(filter(None, [newest.get(keys.VELOCITY.on(name))]), Velocity)
    state, velocity = next(states, None), next(velocities, None)
    if state:
        verdict: str = state.verdict
    elif "safety" in services:
        verdict = "silent"
    else:  # a laptop's service under a robot's name cannot move
        verdict = "-" if services.isdisjoint(MOVES) else "no safety"
    return {
        "robot": name,
        "services": sorted(services),
        "verdict": verdict,
        "latched": list(state.latched) if state else [],
        "source": state.source if state else None,
        "linear": velocity.linear if velocity else None,
        "text": state.text if state else "",
    }
