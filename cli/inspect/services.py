"""``t2 services``: services on the bus with the keys that they publish, read and answer.

Sources are liveliness tokens and, where readable, the router's admin space. ``--dot`` prints the
graph for Graphviz. A session without a token is named by its id: a tool, zenoh-cli, or safety's
second session, which receives the emergency stop.

The admin space lists declarations, not traffic; without it only the tokens are known. Keys that
begin with ``@`` are missing from it (eclipse-zenoh 1.10.2), so publishers of commands are found by
listening.
"""

import argparse
from collections.abc import Sequence
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import short
from cli.inspect.graph import Edge, Member, by_boot, dot, edges, members, title
from cli.inspect.payload import read
from cli.inspect.session import add_options, open_session, wants_json
from common import keys
from common.bus.probe import Probe, intersects
from common.errors import RobotError
from common.text import printable

# The router of a robot that connects to a site's router is a peer there.
ADMIN = "@/*/*/*/t2/v1/{robot}/**"
ROUTER = "@/*/*"
LISTEN_S = 0.5
UNKNOWN_READER = "unknown reader"  # the router reports a reader without its name
CLOSED = "the router does not show readers and publishers (its admin space is closed)"
INFO = ("info/",)  # every service answers these keys


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--dot", action="store_true", help="print the graph for Graphviz")
    parser.add_argument("--info", action="store_true", help="show the keys info/ in text, too")
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Show the services; raise ``RobotError`` without any."""
    with open_session(options) as session:
        found = discover(session.probe, session.robot)
        commands = listen_to_commands(session.probe, session.robot, found)
    if not found:
        raise RobotError("no service found; try `t2 doctor`")
    if not any(each.reads or each.publishes for each in found):
        output.warn(f"t2 services: {CLOSED}")
    links = edges(found, intersects) + commands
    rows = [as_json(each, found, links, session.robot) for each in found]
    if options.dot:
        print(printable(dot(found, links, session.robot), "\n"))
    elif wants_json(options):
        for row in rows:
            output.line(row)
    else:
        print(printable("\n\n".join(as_text(row, options.info) for row in rows), "\n"))
    return 0


def discover(probe: Probe, robot: str) -> list[Member]:
    """Return the sessions on the bus except this one."""
    tokens = probe.alive(keys.live_key(robot, "*", "*"))
    declared = {
        each.key: read(each.payload, each.encoding).value
        for each in probe.query(ADMIN.format(robot=robot))
        if not each.refusal
    }
    return members(tokens, declared, without=(probe.zid,))


def routers(probe: Probe) -> list[dict[str, Any]]:
    """Return the admin record of each router; empty where the admin space is closed."""
    records = (read(each.payload, each.encoding).value for each in probe.query(ROUTER))
    return [each for each in records if isinstance(each, dict)]


def listen_to_commands(probe: Probe, robot: str, found: list[Member]) -> list[Edge]:
    """Add the published commands to each member, and return their edges."""
    boots, received = by_boot(found), set()
    probe.listen(f"{keys.ROOT}/{robot}/@cmd/**")
    for sample in probe.samples(LISTEN_S):
        boot = read(sample.payload, sample.encoding).boot
        if boot not in boots:
            boots[boot] = Member(f"boot {boot}")
            found.append(boots[boot])
        boots[boot].publishes.add(sample.key)
        received.add((boot, sample.key))
    read_keys = {key for _, key in received if probe.has_reader(key)}
    return [
        Edge(title(boots[boot], found), key, UNKNOWN_READER)
        for boot, key in received
        if key in read_keys
    ]


def as_json(
    member: Member, found: Sequence[Member], links: Sequence[Edge], robot: str
) -> dict[str, Any]:
    """Return one member as a JSON object."""
    own = title(member, found)
    return {
        "name": own,
        "service": bool(member.instance),
        "robot": member.robot,
        "instance": member.instance,
        "session": member.zid,
        "publishes": {
            short(key, robot): [
                link.reader for link in links if (link.sender, link.key) == (own, key)
            ]
            for key in sorted(member.publishes)
        },
        "reads": [short(key, robot) for key in sorted(member.reads)],
        "answers": [short(key, robot) for key in sorted(member.answers)],
    }


def as_text(row: dict[str, Any], info: bool) -> str:
    """Return one member as text; ``info`` includes the keys info/."""
    kind = f"instance {row['instance']}" if row["service"] else "session without a service"
    lines = [f"{row['name']}  ({kind})"]
    for key, readers in row["publishes"].items():
        lines.append(f"  publishes  {key:28} -> {', '.join(readers) or 'no reader'}")
    lines += [f"  reads      {key}" for key in row["reads"]]
    lines += [f"  answers    {key}" for key in row["answers"] if info or not key.startswith(INFO)]
    return "\n".join(lines)
