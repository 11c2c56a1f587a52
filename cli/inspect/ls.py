"""``t2 ls``: active keys with type, rate, publishers, readers; ``--services``: all sessions.

A key is active if a message arrives on it while the command listens. The sessions come from
liveliness tokens and from the router's admin space, which lists the sessions that have declared a
key. A session without a token (a tool, safety's session for the emergency stop) has a part of its
id for a name. The admin space omits keys that begin with ``@`` (eclipse-zenoh 1.10.2).
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERYTHING, add_key, chunks, expression, short
from cli.inspect.payload import read
from cli.inspect.session import (
    BusSession,
    add_duration,
    add_options,
    open_session,
    until_interrupt,
)
from common import codec, keys
from common.bus.probe import Probe, intersects
from common.errors import RobotError
from common.text import printable

LISTEN_S = 2.0  # two periods of the slowest streams
ROLES = {"publisher": "publishes", "subscriber": "reads", "queryable": "answers"}
ZENOH_OWN = "@adv"  # declarations of Zenoh itself below a key
# The router of a robot that connects to a site's router is a peer there.
ADMIN = "@/*/*/*/t2/v1/{robot}/**"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser, optional=True)
    parser.add_argument(
        "--services", action="store_true", help="the services, and what each publishes and reads"
    )
    add_duration(parser, LISTEN_S)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List the active keys, or the services; raise ``RobotError`` without any."""
    with open_session(options) as session:
        if options.services:
            return list_services(session, options)
        return list_keys(session, options)


# --- keys -----------------------------------------------------------------------------------------


def list_keys(session: BusSession, options: argparse.Namespace) -> int:
    """List the keys on which messages arrive."""
    words = [options.key] if options.key else EVERYTHING
    wanted = [expression(word, session.robot) for word in words]
    counts: Counter[str] = Counter()
    kinds: dict[str, str] = {}
    for each in wanted:
        session.probe.listen(each)
    began_s = time.monotonic()
    with until_interrupt():
        for sample in session.probe.samples(options.duration):
            counts[sample.key] += 1
            kinds[sample.key] = codec.kind_of(sample.encoding)
    span_s = time.monotonic() - began_s
    if not counts:
        raise RobotError(f"no active key on {', '.join(wanted)}; try `t2 doctor`")
    found = discover(session.probe, session.robot)
    warn_if_closed(found)
    rows = [
        {
            "key": short(key, session.robot),
            "type": kinds[key],
            "hz": count / span_s,
            "publishers": [each.name for each in found if declares(each.publishes, key)],
            "readers": [each.name for each in found if declares(each.reads, key)],
        }
        for key, count in sorted(counts.items())
    ]
    output.rows(rows, as_json=options.json)
    return 0


def declares(declared: set[str], key: str) -> bool:
    """Return whether a key is among these keys, which may have wildcards."""
    return any(intersects(one, key) for one in declared)


# --- sessions -------------------------------------------------------------------------------------


@dataclass(slots=True)
class Member:
    """One session on the bus with its declared keys; a service has an instance."""

    name: str
    robot: str = ""
    instance: str = ""
    publishes: set[str] = field(default_factory=set)
    reads: set[str] = field(default_factory=set)
    answers: set[str] = field(default_factory=set)


def list_services(session: BusSession, options: argparse.Namespace) -> int:
    """List the sessions except this one."""
    found = discover(session.probe, session.robot)
    if not found:
        raise RobotError("no service found; try `t2 doctor`")
    warn_if_closed(found)
    rows = [as_json(each, session.robot) for each in found]
    if options.json:
        for row in rows:
            output.line(row)
    else:
        print(printable("\n\n".join(map(as_text, rows)), "\n"))
    return 0


def warn_if_closed(found: Sequence[Member]) -> None:
    """Warn if the router lists no declaration."""
    if not any(each.reads or each.publishes for each in found):
        output.warn("t2 ls: the router shows no declarations (its admin space is closed)")


def discover(probe: Probe, robot: str) -> list[Member]:
    """Return the services by name, then the other sessions except this one."""
    named = {}
    for token in probe.alive(keys.live_key(robot, "*", "*")):
        owner, path = chunks(token)
        name, _, instance = path.removeprefix("live/").partition("/")
        named[token] = Member(name, owner, instance)
    entries = list(declarations(probe, robot))
    by_zid: dict[str, Member] = {}
    for role, key, zids in entries:
        if role == "token" and key in named:
            by_zid |= dict.fromkeys(zids, named[key])
    for role, key, zids in entries:
        if role in ROLES and ZENOH_OWN not in key:
            for zid in zids - {probe.zid}:
                member = by_zid.setdefault(zid, Member(zid[:8]))
                getattr(member, ROLES[role]).add(key)
    found = [*named.values(), *(each for each in by_zid.values() if not each.instance)]
    return sorted(found, key=lambda each: (not each.instance, each.robot, each.name, each.instance))


def declarations(probe: Probe, robot: str) -> Iterator[tuple[str, str, set[str]]]:
    """Yield role, key and sessions of each declaration.

    All sessions are clients; other entries are routers that declare on behalf of their clients.
    """
    for each in probe.query(ADMIN.format(robot=robot)):
        value = read(each.payload, each.encoding).value
        if not each.refusal and isinstance(value, dict):
            _, _, _, role, key = each.key.split("/", 4)
            yield role, key, {*(value.get("clients") or ())}


def as_json(member: Member, robot: str) -> dict[str, Any]:
    """Return one session as a JSON object."""
    head = {"name": member.name, "robot": member.robot, "instance": member.instance}
    return head | {
        role: [short(key, robot) for key in sorted(getattr(member, role))]
        for role in ROLES.values()
    }


def as_text(row: dict[str, Any]) -> str:
    """Return one session as lines; every service answers the keys info/."""
    kind = f"instance {row['instance']}" if row["instance"] else "session without a service"
    lines = [f"{row['name']}  ({kind})"]
    lines += [f"  publishes  {key}" for key in row["publishes"]]
    lines += [f"  reads      {key}" for key in row["reads"]]
    lines += [f"  answers    {key}" for key in row["answers"] if not key.startswith("info/")]
    return "\n".join(lines)
