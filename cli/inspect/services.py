"""``t2 services``: who is there, who publishes, who reads, who answers; ``--dot`` for Graphviz.

From liveliness tokens and the router's admin space. A session without a token has its id for a
name: a tool, zenoh-cli, or safety's second session, which hears the emergency stop.
"""

import argparse
import sys
from collections.abc import Sequence

from cli.inspect import output
from cli.inspect.addressing import short
from cli.inspect.discovery import overhear, present
from cli.inspect.graph import Edge, Member, dot, edges, title
from cli.inspect.shell import add_options, seated, wants_json
from common.bus.probe import intersects

CLOSED = "the router does not tell who reads and publishes (its admin space is closed to us)"
QUIET = ("info/",)  # every service answers these


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--dot", action="store_true", help="the graph, for Graphviz")
    parser.add_argument("--info", action="store_true", help="the keys info/ too, on a terminal")
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Show who is there; 1 when nobody is."""
    with seated(options) as seat:
        who = present(seat.probe, seat.robot)
        commands = overhear(seat.probe, seat.robot, who)
    if not who:
        print("t2 services: nobody is there; try `t2 doctor`", file=sys.stderr)
        return 1
    if not any(each.reads or each.publishes for each in who):
        print(f"t2 services: {CLOSED}", file=sys.stderr)
    ways = edges(who, intersects) + commands
    if options.dot:
        print(dot(who, ways, seat.robot))
    elif wants_json(options):
        for member in who:
            output.line(as_json(member, who, ways, seat.robot))
    else:
        print("\n\n".join(as_text(each, who, ways, seat.robot, options.info) for each in who))
    return 0


def as_json(
    member: Member, who: Sequence[Member], ways: Sequence[Edge], robot: str
) -> dict[str, object]:
    """Return one member for programs."""
    own = title(member, who)
    return {
        "name": own,
        "service": bool(member.instance),
        "robot": member.robot,
        "instance": member.instance,
        "session": member.zid,
        "publishes": {
            short(key, robot): [w.reader for w in ways if (w.sender, w.key) == (own, key)]
            for key in sorted(member.publishes)
        },
        "reads": [short(key, robot) for key in sorted(member.reads)],
        "answers": [short(key, robot) for key in sorted(member.answers)],
    }


def as_text(
    member: Member, who: Sequence[Member], ways: Sequence[Edge], robot: str, info: bool
) -> str:
    """Return one member for people."""
    own = title(member, who)
    what = f"instance {member.instance}" if member.instance else "a session without a service"
    lines = [f"{own}  ({what})"]
    for key in sorted(member.publishes):
        readers = ", ".join(w.reader for w in ways if (w.sender, w.key) == (own, key))
        lines.append(f"  publishes  {short(key, robot):28} -> {readers or 'nobody'}")
    for key in sorted(member.reads):
        lines.append(f"  reads      {short(key, robot)}")
    for key in sorted(member.answers):
        if info or not short(key, robot).startswith(QUIET):
            lines.append(f"  answers    {short(key, robot)}")
    return "\n".join(lines)
