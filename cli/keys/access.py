"""Who may do what on the bus, by role, as rules for Zenoh's access control. Pure.

A role has rights: a verb on key expressions, made from ``common/keys.py``. A verb is a handful of
Zenoh's messages, by the side that they come from. Whatever is not allowed here is dropped by the
router, and nobody is told; see ``docs/security.md``.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from msgspec import Struct

from common import keys
from common.members import Member

Verb = Literal["read", "know", "recall", "keep", "write", "ask", "serve", "live"]
Rights = Mapping[Verb, Sequence[str]]

# What comes in from a member, and what goes out to it.
VERBS: Mapping[Verb, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "read": (
        ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"),
        ("put", "delete", "liveliness_token"),
    ),
    # Who listens: a publisher that knows of nobody sends one sample and then no more.
    "know": ((), ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")),
    # What advanced publishers keep: zenoh-ext asks by ``@adv/**``, and the answers have the events'
    # own keys.
    "recall": ((), ("query", "reply")),
    "keep": (("reply",), ()),
    "write": (("put", "delete"), ("declare_subscriber",)),
    "ask": (("query",), ("declare_queryable", "reply")),
    "serve": (("declare_queryable", "reply"), ("query",)),
    "live": (("liveliness_token",), ()),
}

ANY = "*"
# ``**`` passes by what begins with ``@``: our commands, and what advanced publishers keep.
EVERY_KEY = f"{keys.ROOT}/**"
EVERY_COMMAND = f"{keys.ROOT}/*/@cmd/**"
# zenoh-ext subscribes to ``KEY/@adv/pub/**`` and asks ``KEY/@adv/**``, for events alone; what it
# publishes and keeps has exactly these chunks: zid, entity or clock, and a name or ``_``.
KEPT = f"{keys.EVENTS.on(ANY, service=ANY)}/@adv/**"
KEPT_KEY = "@adv/pub/*/*/*"
RECALLED = (KEPT, keys.EVENTS.on(ANY, service=ANY))
EVERYTHING = (EVERY_KEY, EVERY_COMMAND, KEPT)
ROUTERS = "@/*/*/**"  # their admin space: version, sessions, who declared what
ASKED = (keys.info_key(ANY, ANY, ANY), KEPT, ROUTERS)

# The services that a laptop runs: a member may speak for these, and for no others. A dead recorder
# on board must be missed, so that one on a laptop is not heard, and does without.
SEATS = ("dashboard", "metrics")
DRIVERS_SEATS = (*SEATS, "teleop")
KNOWING: Rights = {"know": (EVERY_KEY, KEPT), "recall": RECALLED}


class Rule(Struct, frozen=True):
    """One rule of Zenoh's: what passes, and on which keys."""

    id: str
    flow: Literal["ingress", "egress"]
    messages: Sequence[str]
    key_exprs: Sequence[str]

    def as_config(self) -> dict[str, object]:
        """Return it in Zenoh's own words."""
        return {
            "id": self.id,
            "permission": "allow",
            "flows": [self.flow],
            "messages": list(self.messages),
            "key_exprs": list(self.key_exprs),
        }


def access_control(members: Iterable[Member], trusted: Sequence[str]) -> dict[str, object]:
    """Return Zenoh's ``access_control``; ``trusted`` are the link protocols of those on board."""
    subjects: list[dict[str, object]] = [{"id": "onboard", "link_protocols": list(trusted)}]
    granted: dict[str, Rights] = {"onboard": ONBOARD}
    for member in members:
        name = member.common_name
        granted[name] = rights(member)
        subjects.append({"id": name, "cert_common_names": [name]})
    if not trusted:  # an empty list would be refused, and none at all would mean everybody
        subjects, granted = subjects[1:], {k: v for k, v in granted.items() if k != "onboard"}
    rules = {who: list(rules_of(who, given)) for who, given in granted.items()}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule.as_config() for mine in rules.values() for rule in mine],
        "subjects": subjects,
        "policies": [
            {"rules": [rule.id for rule in mine], "subjects": [who]} for who, mine in rules.items()
        ],
    }


def rules_of(who: str, given: Rights) -> Iterable[Rule]:
    """Yield the rules that make up somebody's rights."""
    for verb, expressions in given.items():
        incoming, outgoing = VERBS[verb]
        if incoming:
            yield Rule(f"{who} {verb} in", "ingress", incoming, expressions)
        if outgoing:
            yield Rule(f"{who} {verb} out", "egress", outgoing, expressions)


def rights(member: Member) -> Rights:
    """Return what a member may do, at any router of its site."""
    if member.role == "robot":
        return robot(member.name)
    if member.role == "site":
        return site()
    if member.role == "driver":
        return driver(member.robots, member.sources or (ANY,))
    return fleet() if member.role == "fleet" else viewer()


def viewer() -> Rights:
    """See everything, move nothing."""
    return {
        "read": EVERYTHING,
        **KNOWING,
        "ask": ASKED,
        **seats(SEATS),
    }


def driver(robots: Iterable[str], sources: Sequence[str] = (ANY,)) -> Rights:
    """See everything; drive as the sources named, stop and call the robots named."""
    moved = tuple(robots)
    sitting = seats(DRIVERS_SEATS)
    return {
        "read": EVERYTHING,
        **KNOWING,
        "ask": (*ASKED, *(call.on(each) for each in moved for call in keys.CALLS)),
        **sitting,
        "write": (*sitting["write"], *(key for each in moved for key in orders(each, sources))),
    }


def fleet() -> Rights:
    """See everything; stop any robot, a site, or all."""
    watching = viewer()
    return {**watching, "write": (*watching["write"], keys.estop_key(ANY))}


def site() -> Rights:
    """What a site's router may pass on to a robot's: whom it let in, it has judged itself."""
    return {
        "read": EVERYTHING,
        "know": EVERYTHING,
        "recall": RECALLED,
        "ask": (*ASKED, *(call.on(ANY) for call in keys.CALLS)),
        "write": orders(ANY),
    }


def robot(name: str) -> Rights:
    """What a robot's router may say at its site's: everything of its own robot, nothing else."""
    root = f"{keys.ROOT}/{name}"
    own = (f"{root}/**", f"{root}/@cmd/**", f"{keys.EVENTS.on(name, service=ANY)}/@adv/**")
    return {
        "read": (*own, keys.estop_key(ANY)),
        "know": EVERYTHING,
        "ask": (ROUTERS,),  # its own probe, where nothing on board can dial without TLS
        "write": own,
        "serve": own,
        "live": own,
    }


def orders(robot: str, sources: Sequence[str] = (ANY,)) -> tuple[str, ...]:
    """Return the keys that move and stop a robot, but for what is safety's alone."""
    driven = (keys.DRIVE.on(robot, source=source) for source in sources)
    return (*driven, keys.estop_key(robot))


def seats(services: Iterable[str]) -> dict[Verb, Sequence[str]]:
    """Return the right to speak for services: their health, events, presence, and what is asked."""
    names = tuple(services)
    health = tuple(keys.HEALTH.on(ANY, service=name) for name in names)
    events = tuple(keys.EVENTS.on(ANY, service=name) for name in names)
    kept = tuple(f"{event}/{KEPT_KEY}" for event in events)
    return {
        "write": (*health, *events, *kept),
        "keep": events,
        "serve": (*(keys.info_key(ANY, name, ANY) for name in names), *kept),
        "live": (*(keys.live_key(ANY, name, ANY) for name in names), *kept),
    }


BUS = ("**", "**/@cmd/**", "**/@adv/**", "@/**")
ONBOARD: Rights = dict.fromkeys(VERBS, BUS)
