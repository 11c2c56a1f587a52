"""Who is there, who publishes, who reads, who answers: from liveliness and the router. Pure.

The router's admin space names the sessions that have declared a key. A service's liveliness token
is declared by its session, too, and so names it. A session without a token (a tool, safety's second
one for the emergency stop) is shown by the beginning of its id.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from cli.inspect.addressing import chunks, short

ROLES = {"publisher": "publishes", "subscriber": "reads", "queryable": "answers"}
OWN = "@adv"  # what Zenoh itself declares behind a key


@dataclass(slots=True)
class Member:
    """One session on the bus, with the keys that it has declared."""

    name: str
    zid: str = ""
    robot: str = ""
    instance: str = ""
    publishes: set[str] = field(default_factory=set)
    reads: set[str] = field(default_factory=set)
    answers: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True)
class Edge:
    """One that publishes or calls to one that reads or answers, over a key."""

    sender: str
    key: str
    reader: str


def members(
    tokens: Iterable[str], declared: Mapping[str, Any], without: Iterable[str] = ()
) -> list[Member]:
    """Return who is there: services by name, then sessions without one.

    ``tokens`` are liveliness keys, ``declared`` the router's admin space by key; ``without`` are
    ids of sessions to leave out, such as one's own.
    """
    named = _named(tokens)
    rows = [_declaration(key, value) for key, value in declared.items()]
    by_zid: dict[str, Member] = {}
    for role, key, zids in rows:
        if role == "token" and key in named:
            by_zid |= dict.fromkeys(zids, named[key])
    for role, key, zids in rows:
        for zid in zids if role in ROLES and OWN not in key else ():
            if zid not in without:
                member = by_zid.setdefault(zid, Member(zid[:8]))
                member.zid = zid
                getattr(member, ROLES[role]).add(key)
    strangers = {each.zid: each for each in by_zid.values() if not each.instance}
    return [*sorted(named.values(), key=lambda each: (each.robot, each.name, each.instance)),
            *sorted(strangers.values(), key=lambda each: each.zid)]  # fmt: skip


def title(member: Member, all_of_them: Sequence[Member]) -> str:
    """Return a name that is one member's alone."""
    same = [each for each in all_of_them if (each.robot, each.name) == (member.robot, member.name)]
    return f"{member.name}:{member.instance[:4]}" if len(same) > 1 else member.name


def edges(who: Sequence[Member], meet: Callable[[str, str], bool]) -> list[Edge]:
    """Return every way from one to another; ``meet`` tells whether two expressions intersect."""
    found = {
        Edge(title(sender, who), key, title(reader, who))
        for sender in who
        for key in sender.publishes
        for reader in who
        if reader is not sender and any(meet(key, read) for read in reader.reads)
    }
    return sorted(found, key=lambda edge: (edge.sender, edge.key, edge.reader))


def dot(who: Sequence[Member], ways: Iterable[Edge], robot: str) -> str:
    """Return the graph in Graphviz's language: an arrow for each pair, with its keys."""
    between: dict[tuple[str, str], list[str]] = {}
    for way in ways:
        between.setdefault((way.sender, way.reader), []).append(short(way.key, robot))
    lines = ["digraph t2 {", "  rankdir=LR; node [shape=box];"]
    for member in who:
        style = "" if member.instance else " [style=dashed]"
        lines.append(f'  "{title(member, who)}"{style};')
    for (sender, reader), keys in between.items():
        words = "\\n".join(keys)
        lines.append(f'  "{sender}" -> "{reader}" [label="{words}"];')
    return "\n".join([*lines, "}"])


def publishers(who: Sequence[Member]) -> dict[str, list[str]]:
    """Return who has declared to publish each key."""
    found: dict[str, list[str]] = {}
    for member in who:
        for key in member.publishes:
            found.setdefault(key, []).append(title(member, who))
    return found


def by_boot(who: Iterable[Member]) -> dict[int | None, Member]:
    """Return whose messages bear which ``boot``: a service's token is named by it."""
    found: dict[int | None, Member] = {}
    for member in who:
        with suppress(ValueError):  # a token of another make
            found[int(member.instance, 16)] = member
    return found


def _named(tokens: Iterable[str]) -> dict[str, Member]:
    """Return the services that liveliness tokens ``.../live/{service}/{instance}`` tell of."""
    named = {}
    for token in tokens:
        robot, path = chunks(token)
        name, _, instance = path.removeprefix("live/").partition("/")
        if instance:
            named[token] = Member(name, robot=robot, instance=instance)
    return named


def _declaration(key: str, value: Any) -> tuple[str, str, list[str]]:
    """Return role, key and ids of the sessions of one entry ``@/ZID/MODE/ROLE/KEY``.

    All sessions are clients; what else has declared it is a router, which stands for its own.
    """
    parts = key.split("/", 4)
    if len(parts) < 5 or not isinstance(value, dict):
        return "", "", []
    return parts[3], parts[4], list(value.get("clients") or ())
