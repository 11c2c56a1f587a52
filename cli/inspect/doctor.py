"""``t2 doctor``: diagnosis of the path from this laptop to the wheels, with remedies.

It checks in the order of a request's path: network, router, services, versions, rights, clock,
board, switches, sensors, drivers, safety. It only listens and queries; it changes nothing.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from importlib.metadata import version

from cli.inspect import output, remedies
from cli.inspect.addressing import (
    EVERYTHING,
    WRONG_SERVICE,
    chunks,
    expression,
    service_of,
    topic_of,
)
from cli.inspect.connect_probe import connect
from cli.inspect.diagnosis import Finding, Observation, diagnose_bus, network
from cli.inspect.services import discover, routers
from cli.inspect.session import add_duration, add_options, settings, until_interrupt, wants_json
from cli.inspect.vehicle import diagnose_vehicle
from common import codec, keys
from common import messages as m
from common.bus.probe import Probe, probe
from common.bus.publisher import host_id
from common.cli_args import VERSION
from common.errors import LinkError, MessageError
from common.freshness import NS_PER_S
from common.sample import Sample
from common.settings import Shared

LISTEN_S = 3.0  # a 1 Hz stream arrives at least twice
MARKS = {"ok": "ok", "note": "note", "wrong": "WRONG", "unknown": "?"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_duration(parser, LISTEN_S)
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Print all findings; return 1 if something is wrong."""
    as_json = wants_json(options)
    wrong = 0
    for finding in findings(settings(options), options.duration):
        wrong += finding.level == "wrong"
        output.line(asdict(finding)) if as_json else print(as_text(finding), flush=True)
    if not as_json:
        print(f"\n{wrong or 'No'} problem{'s' * (wrong != 1)} found.")
    return 1 if wrong else 0


def findings(config: Shared, seconds: float) -> Iterator[Finding]:
    """Yield the findings in order; without a router the rest is unknown."""
    attempts = [connect(endpoint, config.bus) for endpoint in config.bus.endpoints]
    yield from network(attempts)
    if all(each.trouble for each in attempts):
        yield Finding("router", "unknown", "router unreachable; later checks are skipped")
        return
    try:
        with probe(config.bus) as opened:
            seen = observe(opened, config.robot.id, seconds)
    except LinkError:
        text = "the endpoint accepts connections but is not a router"
        yield Finding("router", "wrong", text, remedies.NOT_A_ROUTER)
        return
    yield from diagnose_bus(seen)
    yield from diagnose_vehicle(seen)


def observe(opened: Probe, robot: str, seconds: float) -> Observation:
    """Return the observation of one robot."""
    seen = Observation(zenoh=version("eclipse-zenoh"), t2=VERSION)
    texts = (str(each.get("version", "")) for each in routers(opened))
    seen.routers = [text.removeprefix("v").partition("-")[0] for text in texts]
    listen(opened, robot, seconds, seen)
    for member in discover(opened, robot):
        if member.instance:
            seen.instances[member.name] = seen.instances.get(member.name, 0) + 1
    if "safety" in seen.instances:
        seen.may_drive = opened.has_reader(keys.DRIVE.on(robot, source="teleop"))
        seen.may_call = opened.has_server(keys.RESET.on(robot))
    return seen


def listen(opened: Probe, robot: str, seconds: float, seen: Observation) -> None:
    """Add the messages of one robot to the observation."""
    counts: Counter[str] = Counter()
    host = host_id()
    for word in EVERYTHING:
        opened.listen(expression(word, robot))
    with until_interrupt():
        for sample in opened.samples(seconds):
            counts[chunks(sample.key)[1]] += 1
            add_sample(sample, seen, host)
    seen.rates = {path: count / seconds for path, count in counts.items()}


def add_sample(sample: Sample, seen: Observation, host: int) -> None:
    """Add one sample, if its key is a topic."""
    path, topic = chunks(sample.key)[1], topic_of(sample.key)
    if topic is None:
        return
    try:
        message = codec.decode(sample.payload, topic.message)
    except MessageError as error:
        seen.undecodable[path] = str(error)
        return
    if isinstance(message, m.Health) and message.service != service_of(sample.key):
        seen.undecodable[path] = WRONG_SERVICE
        return
    if path.startswith("tel/"):
        seen.delays_s.append((sample.wall_ns - message.t_ns) / NS_PER_S)
        seen.one_clock |= host != 0 and message.host == host
    seen.add(message, path.rsplit("/", 1)[-1])


def as_text(finding: Finding) -> str:
    """Return a finding as text, with its remedy on a second line."""
    text = f"{finding.where:9} {MARKS[finding.level]:6} {output.printable(finding.text)}"
    return f"{text}\n{'':17}-> {finding.todo}" if finding.todo else text
