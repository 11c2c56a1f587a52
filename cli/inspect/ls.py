"""``t2 ls``: active keys with type, rate, publishers, readers; ``--services``: all declarations.

A key is active if a message arrives on it while the command listens. The router's admin space lists
the sessions that have declared a key. A session is named by its liveliness token, as
``bridge/1f3a9c``. One without a token (a tool, safety's session for the emergency stop) has a part
of its id for a name. The admin space omits keys that begin with ``@`` (eclipse-zenoh 1.10.2).
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
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
from common.bus.inspector import Inspector, intersects
from t2 import codec
from t2.errors import T2Error

LISTEN_S = 2.0  # two periods of the slowest streams
ROLES = {"publisher": "publishes", "subscriber": "reads", "queryable": "answers"}
EVERYWHERE = ("@adv", "/info/")  # Zenoh's own below a key, and what every service answers
# The router of a robot that connects to a site's router is a peer there.
ADMIN = "@/*/*/*/t2/v1/{robot}/**"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser, optional=True)
    parser.add_argument(
        "--services", action="store_true", help="the keys that each service publishes and reads"
    )
    add_duration(parser, LISTEN_S)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List the active keys, or the declarations; raise ``T2Error`` without any."""
    with open_session(options) as session:
        rows = declared(session) if options.services else active(session, options)
    output.rows(rows, as_json=options.json)
    return 0


def active(session: BusSession, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Return the keys on which messages arrive."""
    words = [options.key] if options.key else EVERYTHING
    wanted = [expression(word, session.robot) for word in words]
    counts: Counter[str] = Counter()
    kinds: dict[str, str] = {}
    for each in wanted:
        session.inspector.listen(each)
    began_s = time.monotonic()
    with until_interrupt():
        for sample in session.inspector.samples(options.duration):
            counts[sample.key] += 1
            kinds[sample.key] = codec.kind_of(sample.encoding) or named(sample.encoding)
    span_s = time.monotonic() - began_s
    if not counts:
        raise T2Error(f"no active key on {', '.join(wanted)}; try {session.inspector.doctor}")
    found = declarations(session.inspector, session.robot)
    if not found:
        output.warn("t2 ls: the router shows no declarations (its admin space is closed)")
    return [
        {
            "key": short(key, session.robot),
            "type": kinds[key],
            "hz": count / span_s,
            "publishers": services(found, "publishes", key),
            "readers": services(found, "reads", key),
        }
        for key, count in sorted(counts.items())
    ]


def named(encoding: str) -> str:
    """Return the encoding of another program's message; empty if it has set none."""
    return "" if encoding == "zenoh/bytes" else encoding


def declared(session: BusSession) -> list[dict[str, Any]]:
    """Return all declarations except those of this session."""
    found = declarations(session.inspector, session.robot)
    if not found:
        text = "no service found, or the router shows none"
        raise T2Error(f"{text}; try {session.inspector.doctor}")
    return [
        {"session": each.session, "does": each.does, "key": short(each.key, session.robot)}
        for each in found
    ]


@dataclass(frozen=True, slots=True, order=True)
class Declaration:
    """A key that a session has declared."""

    session: str  # of a service: NAME/INSTANCE
    does: str  # a value of ROLES
    key: str  # may have wildcards


def declarations(inspector: Inspector, robot: str) -> list[Declaration]:
    """Return the declarations of the other sessions.

    All sessions are clients; other entries are routers that declare on behalf of their clients.
    """
    entries: list[tuple[str, str, set[str]]] = []  # role, key, sessions
    for each in inspector.query(ADMIN.format(robot=robot)):
        value = read(each.payload, each.encoding).value
        if not each.refusal and isinstance(value, dict):
            _, _, _, role, key = each.key.split("/", 4)
            entries.append((role, key, {*(value.get("clients") or ())} - {inspector.zid}))
    names = {
        zid: chunks(key)[1].removeprefix("live/")
        for role, key, zids in entries
        if role == "token"
        for zid in zids
    }
    return sorted(
        Declaration(names.get(zid, zid[:8]), ROLES[role], key)
        for role, key, zids in entries
        if role in ROLES and not any(part in key for part in EVERYWHERE)
        for zid in zids
    )


def services(found: Iterable[Declaration], does: str, key: str) -> list[str]:
    """Return the names of those that have declared a key."""
    return [
        each.session.rpartition("/")[0] or each.session
        for each in found
        if each.does == does and intersects(each.key, key)
    ]
