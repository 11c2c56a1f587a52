"""``t2 topic``: the subcommands of ``ros2 topic``, and ``t2 topic info``."""

import argparse
from collections.abc import Callable

from cli.inspect import echo, ls, measure, output, pub
from cli.inspect.addressing import expression, parse_one_key, short, topic_of
from cli.inspect.graph import by_boot, title
from cli.inspect.payload import read
from cli.inspect.services import discover
from cli.inspect.session import BusSession, add_options, open_session
from common import codec
from common.bus.probe import intersects

LISTEN_S = 2.0


def add_info_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``t2 topic info``."""
    parser.add_argument("key", metavar="KEY", type=parse_one_key, help="such as tel/odom/odometry")
    add_options(parser, every=False)


def run_info(options: argparse.Namespace) -> int:
    """Show a key; return 1 if it has neither publisher nor reader."""
    with open_session(options) as session:
        found = info(session, expression(options.key, session.robot))
    output.value(found, options.output)
    if not found["publishers"] and not found["readers"]:
        output.warn("t2 topic info: the key has no publisher and no reader")
        return 1
    return 0


def info(session: BusSession, key: str) -> dict[str, object]:
    """Return type, rate, publishers and readers of a key."""
    members = discover(session.probe, session.robot)
    boots, topic = by_boot(members), topic_of(key)
    kind, senders = topic.message.__name__ if topic else "", set[str]()
    session.probe.listen(key)
    sample = session.probe.take(LISTEN_S)
    if sample:
        boot = read(sample.payload, sample.encoding).boot
        kind = codec.kind_of(sample.encoding) or kind
        senders = {title(boots[boot], members) if boot in boots else f"boot {boot}"}

    def named(declared: str) -> set[str]:
        return {
            title(member, members)
            for member in members
            if any(intersects(key, each) for each in getattr(member, declared))
        }

    return {
        "key": short(key, session.robot),
        "type": kind,
        "carries": topic.what if topic else "",
        "hz": topic.rate_hz if topic else None,
        "class": topic.service.name if topic else "",
        "publishers": sorted(named("publishes") | senders),
        "readers": sorted(named("reads")),
    }


SUBCOMMANDS: dict[str, tuple[Callable[..., None], Callable[..., int], str]] = {
    "list": (ls.add_arguments, ls.run, "list the active keys; also `t2 ls`"),
    "info": (add_info_arguments, run_info, "type, publishers and readers of a key"),
    "echo": (echo.add_arguments, echo.run, "print messages; also `t2 echo`"),
    "hz": (measure.add_arguments, measure.run, "measure the rate; also `t2 hz`"),
    "delay": (measure.add_arguments, measure.run, "measure the delay; also `t2 delay`"),
    "bw": (measure.add_arguments, measure.run, "measure the bandwidth; also `t2 bw`"),
    "pub": (pub.add_arguments, pub.run, "publish; also `t2 pub`"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add a parser for each subcommand."""
    parsers = parser.add_subparsers(dest="subcommand", required=True, metavar="WORD")
    for name, (add, _, text) in SUBCOMMANDS.items():
        add(parsers.add_parser(name, help=text, description=text))


def run(options: argparse.Namespace) -> int:
    """Run the subcommand, under the name of its own command if it has one."""
    if options.subcommand != "info":
        options.command = options.subcommand
    return SUBCOMMANDS[options.subcommand][1](options)
