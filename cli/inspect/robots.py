"""``t2 robots``: robots on the bus with services, safety verdict and driving source.

Tokens of a robot's own services list the robots; safety's newest state gives the verdict.
"""

import argparse
from collections import defaultdict
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERY_ROBOT
from cli.inspect.client import SafetyClient
from cli.inspect.session import add_options, open_session, services
from common.cli_args import reader_language
from t2 import keys
from t2.errors import T2Error
from t2.messages import SafetyState
from t2.words import Language, render

LISTEN_S = 1.5  # at most; over a thin uplink a stream may have 1 Hz


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List the robots; return 1 if one that moves has no safety state."""
    options.robot = options.robot or EVERY_ROBOT
    language: Language = "en" if options.json else reader_language()
    running: defaultdict[str, set[str]] = defaultdict(set)
    with open_session(options) as session:
        client = SafetyClient(session.inspector, session.robot)
        for name, service in services(session.inspector, session.robot):
            running[name].add(service)
        found = {name: has for name, has in running.items() if not has.isdisjoint(keys.ON_BOARD)}
        supervised = {name for name, has in found.items() if "safety" in has}
        client.until(lambda: client.states.keys() >= supervised, LISTEN_S)
    if not found:
        raise T2Error(f"no robot found; try {session.inspector.doctor}")
    states = client.states
    rows = [row(name, found[name], states.get(name), language) for name in sorted(found)]
    output.rows(rows, as_json=options.json)
    return 1 if {"silent", "no safety"} & {each["verdict"] for each in rows} else 0


def row(
    name: str, services: set[str], state: SafetyState | None, language: Language
) -> dict[str, Any]:
    """Return one robot as a JSON object."""
    if state:
        verdict: str = state.verdict
    elif "safety" in services:
        verdict = "silent"
    else:
        verdict = "no safety"
    return {
        "robot": name,
        "services": sorted(services),
        "verdict": verdict,
        "latched": list(state.latched) if state else [],
        "source": state.source if state else None,
        "text": render(state.phrases, language, state.text) if state else "",
    }
