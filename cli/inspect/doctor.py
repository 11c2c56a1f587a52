"""``t2 doctor``: what is wrong between this laptop and the wheels, and what to do about it.

It walks the way that a request takes: network, router, services, versions, rights, clock, board,
switches, sensors, drivers, safety. It listens and asks, and changes nothing.
"""

import argparse
from collections.abc import Iterator
from dataclasses import asdict
from importlib.metadata import version

from cli.inspect import output, remedies
from cli.inspect.collector import listen
from cli.inspect.connect_probe import dial
from cli.inspect.diagnosis import Dial, Finding, Seen, network, on_the_way
from cli.inspect.discovery import present, routers
from cli.inspect.shell import add_options, positive, settings, wants_json
from cli.inspect.vehicle import at_the_vehicle
from common import keys
from common.bus.probe import Probe, probe
from common.cli_args import VERSION
from common.errors import LinkError
from common.settings import Shared

LISTEN_S = 3.0  # what comes once a second comes twice


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--duration", type=positive, default=LISTEN_S, metavar="S",
        help=f"listen so long, {LISTEN_S:g} s by default",
    )  # fmt: skip
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Tell all findings; 1 when something is wrong."""
    as_json = wants_json(options)
    wrong = 0
    for finding in findings(settings(options), options.duration):
        wrong += finding.level == "wrong"
        output.line(asdict(finding)) if as_json else print(as_text(finding), flush=True)
    if not as_json:
        print(f"\n{wrong or 'No'} thing{'s' * (wrong != 1)} wrong.")
    return 1 if wrong else 0


def findings(config: Shared, seconds: float) -> Iterator[Finding]:
    """Yield what is found, as it is found; the rest is unknown without a router."""
    dials: list[Dial] = [dial(endpoint, config.bus) for endpoint in config.bus.endpoints]
    yield from network(dials)
    if all(each.trouble for each in dials):
        yield Finding("router", "unknown", "and all behind it: the router cannot be reached")
        return
    try:
        with probe(config.bus) as opened:
            seen = look(opened, config.robot.id, seconds)
    except LinkError:
        yield Finding("router", "wrong", "what answers there is no router", remedies.NOT_A_ROUTER)
        return
    yield from on_the_way(seen)
    yield from at_the_vehicle(seen)


def look(opened: Probe, robot: str, seconds: float) -> Seen:
    """Return what is seen of one robot within so many seconds."""
    seen = Seen(zenoh=version("eclipse-zenoh"), t2=VERSION)
    told = (str(each.get("version", "")) for each in routers(opened))
    seen.routers = [text.removeprefix("v").partition("-")[0] for text in told]
    listen(opened, robot, seconds, seen)
    for member in present(opened, robot):
        if member.instance:
            seen.instances[member.name] = seen.instances.get(member.name, 0) + 1
    if "safety" in seen.instances:
        seen.may_drive = opened.has_reader(keys.DRIVE.on(robot, source="teleop"))
        seen.may_call = opened.has_server(keys.RESET.on(robot))
    return seen


def as_text(finding: Finding) -> str:
    """Return a finding for people: what to do stands below it."""
    mark = {"ok": "ok", "note": "note", "wrong": "WRONG", "unknown": "?"}[finding.level]
    text = f"{finding.where:9} {mark:6} {output.printable(finding.text)}"
    return f"{text}\n{'':17}-> {finding.todo}" if finding.todo else text
