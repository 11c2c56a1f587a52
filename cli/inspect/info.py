"""``t2 topic info``: what a key carries, who publishes it and who reads it."""

import argparse
import sys

from cli.inspect import output
from cli.inspect.addressing import expression, one_key, short, topic_of
from cli.inspect.discovery import present
from cli.inspect.graph import by_boot, title
from cli.inspect.payload import read
from cli.inspect.shell import Seat, add_options, seated, wants_json
from common import codec
from common.bus.probe import intersects

LISTEN_S = 2.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("key", metavar="KEY", type=one_key, help="such as tel/odom/odometry")
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Show it; 1 when nobody publishes or reads it."""
    with seated(options) as seat:
        told = info(seat, expression(options.key, seat.robot))
    output.line(told) if wants_json(options) else print(output.fields(told))
    if not told["publishers"] and not told["readers"]:
        print("t2 topic info: nobody publishes it and nobody reads it", file=sys.stderr)
        return 1
    return 0


def info(seat: Seat, key: str) -> dict[str, object]:
    """Return what is known of a key."""
    who = present(seat.probe, seat.robot)
    boots, topic = by_boot(who), topic_of(key)
    kind, senders = topic.message.__name__ if topic else "", set[str]()
    seat.probe.listen(key)
    heard = seat.probe.take(LISTEN_S)
    if heard:
        value = read(heard.payload, heard.encoding).value
        boot = value.get("boot") if isinstance(value, dict) else None
        kind = codec.kind_of(heard.encoding) or kind
        senders = {title(boots[boot], who) if boot in boots else f"boot {boot}"}
    declared = {title(m, who) for m in who if any(intersects(key, each) for each in m.publishes)}
    return {
        "key": short(key, seat.robot),
        "type": kind,
        "carries": topic.what if topic else "",
        "hz": topic.rate_hz if topic else None,
        "class": topic.service.name if topic else "",
        "publishers": sorted(declared | senders),
        "readers": sorted(
            title(m, who) for m in who if any(intersects(key, each) for each in m.reads)
        ),
    }
