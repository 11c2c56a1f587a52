"""Graph of sessions on the bus with the keys that they publish, read and answer. Pure.

Sources are liveliness tokens and the router's admin space, which lists the sessions that have
declared a key. A service's session also declares its token, which gives the session's name. A
session without a token (a tool, safety's session for the emergency stop) has a part of its id for a
name.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from cli.inspect.addressing import chunks, short

ROLES = {"publisher": "publishes", "subscriber": "reads", "queryable": "answers"}
ZENOH_OWN = "@adv"  # declarations of Zenoh itself below a key


@dataclass(slots=True)
class Member:
    """One session on the bus with its declared keys."""

    name: str
    zid: str = ""
    robot: str = ""
    instance: str = ""
    publishes: set[str] = field(default_factory=set)
    reads: set[str] = field(default_factory=set)
    answers: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True)
class Edge:
    """A publisher and a reader of one key."""

    sender: str
    key: str
    reader: str


def members(
    tokens: Iterable[str], declared: Mapping[str, Any], without: Iterable[str] = ()
) -> list[Member]:
    """Return services by name, then sessions without a service.

    ``tokens`` are liveliness keys, ``declared`` is the router's admin space by key. Session ids in
    ``without`` are left out.
    """
    named = _services(tokens)
    rows = [_declaration(key, value) for key, value in declared.items()]
    by_zid: dict[str, Member] = {}
    for role, key, zids in rows:
        if role == "token" and key in named:
            by_zid |= dict.fromkeys(zids, named[key])
    for role, key, zids in rows:
        for zid in zids if role in ROLES and ZENOH_OWN not in key else ():
            if zid not in without:
                member = by_zid.setdefault(zid, Member(zid[:8]))
                member.zid = zid
                getattr(member, ROLES[role]).add(key)
    unnamed = {each.zid: each for each in by_zid.values() if not each.instance}
    return [*sorted(named.values(), key=lambda each: (each.robot, each.name, each.instance)),
            *sorted(unnamed.values(), key=lambda each: each.zid)]  # fmt: skip


def title(member: Member, found: Sequence[Member]) -> str:
    """Return a unique name of a member."""
    same = [each for each in found if (each.robot, each.name) == (member.robot, member.name)]
    return f"{member.name}:{member.instance[:4]}" if len(same) > 1 else member.name


def edges(found: Sequence[Member], intersects: Callable[[str, str], bool]) -> list[Edge]:
    """Return all edges; ``intersects`` compares two key expressions."""
    links = {
        Edge(title(sender, found), key, title(reader, found))
        for sender in found
        for key in sender.publishes
        for reader in found
        if reader is not sender and any(intersects(key, read) for read in reader.reads)
    }
    return sorted(links, key=lambda edge: (edge.sender, edge.key, edge.reader))


def dot(found: Sequence[Member], links: Iterable[Edge], robot: str) -> str:
    """Return the graph in the DOT language: one arrow per pair, labelled with its keys."""
    between: dict[tuple[str, str], list[str]] = {}
    for link in links:
        between.setdefault((link.sender, link.reader), []).append(short(link.key, robot))
    lines = ["digraph t2 {", "  rankdir=LR; node [shape=box];"]
    for member in found:
        style = "" if member.instance else " [style=dashed]"
        lines.append(f'  "{title(member, found)}"{style};')
    for (sender, reader), keys in between.items():
        label = "\\n".join(keys)
        lines.append(f'  "{sender}" -> "{reader}" [label="{label}"];')
    return "\n".join([*lines, "}"])


def by_boot(found: Iterable[Member]) -> dict[int | None, Member]:
    """Return the services by the ``boot`` of their messages, which is part of their tokens."""
    boots: dict[int | None, Member] = {}
    for member in found:
        with suppress(ValueError):  # not a token of ours
            boots[int(member.instance, 16)] = member
    return boots


def _services(tokens: Iterable[str]) -> dict[str, Member]:
    """Return the services of liveliness tokens ``.../live/{service}/{instance}``."""
    named = {}
    for token in tokens:
        robot, path = chunks(token)
        name, _, instance = path.removeprefix("live/").partition("/")
        if instance:
            named[token] = Member(name, robot=robot, instance=instance)
    return named


def _declaration(key: str, value: Any) -> tuple[str, str, list[str]]:
    """Return role, key and session ids of one entry ``@/ZID/MODE/ROLE/KEY``.

    All sessions are clients; other entries are routers that declare on behalf of their clients.
    """
    parts = key.split("/", 4)
    if len(parts) < 5 or not isinstance(value, dict):
        return "", "", []
    return parts[3], parts[4], list(value.get("clients") or ())
