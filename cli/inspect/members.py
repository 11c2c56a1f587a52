"""Sessions on the bus with the keys that they publish, read and answer.

Sources are liveliness tokens and the router's admin space, which lists the sessions that have
declared a key. A service's session also declares its token, which gives the session's name. A
session without a token (a tool, safety's session for the emergency stop) has a part of its id for a
name. The admin space lists declarations, not traffic. Without it only the tokens are known. It
omits keys that begin with ``@`` (eclipse-zenoh 1.10.2).
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from cli.inspect.addressing import chunks
from cli.inspect.payload import read
from common import keys
from common.bus.probe import Probe

ROLES = {"publisher": "publishes", "subscriber": "reads", "queryable": "answers"}
ZENOH_OWN = "@adv"  # declarations of Zenoh itself below a key
# The router of a robot that connects to a site's router is a peer there.
ADMIN = "@/*/*/*/t2/v1/{robot}/**"


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


def discover(probe: Probe, robot: str) -> list[Member]:
    """Return the sessions on the bus except this one."""
    tokens = probe.alive(keys.live_key(robot, "*", "*"))
    declared = {
        each.key: read(each.payload, each.encoding).value
        for each in probe.query(ADMIN.format(robot=robot))
        if not each.refusal
    }
    return members(tokens, declared, without=(probe.zid,))


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
