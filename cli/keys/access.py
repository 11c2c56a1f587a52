"""Access rules of the bus by role, for Zenoh's access control. Pure.

A role has rights: a verb on key expressions, of ``sdk/t2/keys.py`` and of ROS 2. A verb stands for
a set of Zenoh messages in each direction. The router drops all other messages without notice; see
``docs/security.md``.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from cli.keys.members import OPERATORS_SOURCES, Member, Profile
from services.ros2 import names, parameters
from services.ros2.config import Ros2
from services.ros2.fixes import POSE
from t2 import keys

Verb = Literal["read", "know", "recall", "keep", "write", "ask", "serve", "live"]
Rights = Mapping[Verb, Sequence[str]]

# Messages from a member (ingress), and messages to it (egress).
VERBS: Mapping[Verb, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "read": (
        ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"),
        ("put", "delete", "liveliness_token"),
    ),
    # Lists subscribers: a publisher without known subscribers stops after one sample.
    "know": ((), ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")),
    # The caches of advanced publishers: zenoh-ext queries ``@adv/**``, and replies have the events'
    # own keys.
    "recall": ((), ("query", "reply")),
    "keep": (("reply",), ()),
    "write": (("put", "delete"), ("declare_subscriber",)),
    "ask": (("query",), ("declare_queryable", "reply")),
    "serve": (("declare_queryable", "reply"), ("query",)),
    "live": (("liveliness_token",), ()),
}

ANY = "*"
# ``**`` does not match chunks that begin with ``@``: commands, and caches of advanced publishers.
EVERY_KEY = f"{keys.ROOT}/**"
EVERY_COMMAND = f"{keys.ROOT}/*/@cmd/**"
# zenoh-ext subscribes to ``KEY/@adv/pub/**`` and queries ``KEY/@adv/**``, only for events. A cache
# has exactly these chunks: zid, entity or clock, and a name or ``_``.
KEPT = f"{keys.EVENTS.on(ANY, service=ANY)}/@adv/**"
KEPT_KEY = "@adv/pub/*/*/*"
RECALLED = (KEPT, keys.EVENTS.on(ANY, service=ANY))
EVERYTHING = (EVERY_KEY, EVERY_COMMAND, KEPT)
ROUTERS = "@/*/*/**"  # their admin space: version, sessions, declarations
EVERY_APP = f"{keys.app_key(ANY, ANY)}/**"
QUERYABLE = (keys.info_key(ANY, ANY, ANY), KEPT, ROUTERS, EVERY_APP)
APP_DEPTH = 6  # chunks below a member's own prefix: matching of long keys hangs a router

# The services of a laptop: a member may publish as these and as no others. A recorder is not one of
# them: a recorder on a laptop must not hide that the one on board is dead.
LAPTOP_SERVICES = ("dashboard", "estop", "metrics")
DRIVER_SERVICES = (*LAPTOP_SERVICES, "teleop")

COMMANDS: Mapping[str, Sequence[keys.Topic[Any]]] = {  # besides the emergency stop
    "driver": (keys.DRIVE, keys.LIMIT),
    "device": (keys.LIMIT, keys.FIX),
}
# Without an operator's source.
PROGRAMS_CALLS = (keys.SET_LED, keys.SET_POSE, keys.TEACH, keys.ROUND)
ROS_TWISTS = ("TwistStamped", "Twist")
ROS_CALLS = ("hardware/e_stop_trigger", "hardware/e_stop_reset")
ROS_TOKENS = (7, 11, 12)  # chunks after the domain: of a node, an endpoint, one with backends


class RouterSettings(NamedTuple):
    """The router's own settings that rights depend on."""

    robot: str = "001"
    ros2: Ros2 = Ros2()


def access_control(
    members: Iterable[Member], trusted: Sequence[str], router: RouterSettings
) -> dict[str, object]:
    """Return Zenoh's ``access_control``; on-board clients use the ``trusted`` link protocols."""
    subjects: list[dict[str, object]] = []
    rules: dict[str, list[dict[str, object]]] = {}
    if trusted:  # Zenoh rejects an empty list, and a missing one means every protocol
        subjects.append({"id": "onboard", "link_protocols": list(trusted)})
        rules["onboard"] = list(_rules("onboard", ONBOARD))
    for member in members:
        name = member.common_name
        if own := list(_rules(name, rights(member, router))):  # Zenoh rejects an empty policy
            subjects.append({"id": name, "cert_common_names": [name]})
            rules[name] = own
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for each in rules.values() for rule in each],
        "subjects": subjects,
        "policies": [
            {"rules": [rule["id"] for rule in each], "subjects": [name]}
            for name, each in rules.items()
        ],
    }


def _rules(name: str, given: Rights) -> Iterator[dict[str, object]]:
    """Yield Zenoh's rules for the rights of a member."""
    for verb, expressions in given.items():
        for flow, messages in zip(("ingress", "egress"), VERBS[verb], strict=True):
            if messages:
                yield {
                    "id": f"{name} {verb} {flow}",
                    "permission": "allow",
                    "flows": [flow],
                    "messages": list(messages),
                    "key_exprs": list(expressions),
                }


def rights(member: Profile, router: RouterSettings) -> Rights:
    """Return the rights of a member at a router of its site."""
    if member.role == "ros":
        return ros(router.ros2) if {router.robot, ANY} & {*member.robots} else {}
    if member.role == "robot":
        return robot(member.name)
    return site() if member.role == "site" else laptop(member)


def laptop(member: Profile) -> Rights:
    """Return the rights to see everything; drivers drive, devices limit and locate, they all stop.

    Drivers and devices do so for their robots, as their sources. Only an operator also resets. Each
    publishes on keys of its own.
    """
    role, sources = member.role, member.sources
    robots = {"viewer": (), "fleet": (ANY,)}.get(role, member.robots)
    calls: Sequence[keys.Call[Any, Any]] = ()
    if role == "driver":
        calls = keys.CALLS if {*OPERATORS_SOURCES} & {*sources} else PROGRAMS_CALLS
    own = publishing(DRIVER_SERVICES if role == "driver" else LAPTOP_SERVICES)
    apps = [key for each in member.robots or (ANY,) for key in app_keys(each, member.name)]
    topics = COMMANDS.get(role, ())
    commands = (topic.on(each, source=s) for topic in topics for each in robots for s in sources)
    return {
        **own,
        "read": EVERYTHING,
        "know": (EVERY_KEY, KEPT),
        "recall": (*RECALLED, EVERY_APP),
        "ask": (
            *QUERYABLE,
            *(call.on(ANY) for call in keys.READING_CALLS),
            *(call.on(each) for each in robots for call in calls),
        ),
        "write": (*own["write"], *apps, *commands, *map(keys.estop_key, robots)),
        "serve": (*own["serve"], *apps),
        "live": (*own["live"], *apps),
    }


def app_keys(robot: str, name: str) -> Sequence[str]:
    """Return the expressions of a member's own keys, each of a fixed length."""
    prefix = keys.app_key(robot, name)
    return [prefix + f"/{ANY}" * depth for depth in range(APP_DEPTH + 1)]


def site() -> Rights:
    """Return the rights of a site's router at a robot's: it has checked its own members."""
    return {
        "read": EVERYTHING,
        "know": EVERYTHING,
        "recall": RECALLED,
        "ask": (*QUERYABLE, *(call.on(ANY) for call in keys.CALLS)),
        "write": (
            *(topic.on(ANY, source=ANY) for topic in (keys.DRIVE, keys.LIMIT, keys.FIX)),
            keys.estop_key(ANY),
            *(keys.EVENTS.on(ANY, service=name) for name in DRIVER_SERVICES),
            *app_keys(ANY, ANY),
        ),
    }


def robot(name: str) -> Rights:
    """Return the rights of a robot's router at its site's: everything for its own robot."""
    root = f"{keys.ROOT}/{name}"
    own = (f"{root}/**", f"{root}/@cmd/**", f"{keys.EVENTS.on(name, service=ANY)}/@adv/**")
    return {
        "read": (*own, keys.estop_key(ANY)),
        "know": EVERYTHING,
        "ask": (ROUTERS,),  # for its own probe, if no on-board endpoint works without TLS
        "write": own,
        "serve": own,
        "live": own,
    }


def ros(settings: Ros2) -> Rights:
    """Return the rights of a computer with ROS 2: read topics, command velocity, stop and reset.

    It writes the poses that ``fixes`` names, too. It has no rights on the keys of T2.
    """
    domain = settings.domain
    topics, kept = f"{domain}/**", f"{domain}/**/@adv/**"  # ``**`` does not match @adv
    everything = (topics, kept, f"{names.LIVELINESS}/{domain}/**")

    def key(name: str, interface: str) -> str:
        return names.data_key(domain, names.absolute(settings.namespace, name), interface)

    calls = dict.fromkeys(ROS_CALLS, "std_srvs/srv/Trigger")
    for name, (interface, _) in parameters.SERVICES.items():
        calls[f"{names.NODE}/{name}"] = interface
    return {
        "read": everything,
        "know": everything,
        "recall": (topics, kept),
        "ask": (kept, *(key(name, interface) for name, interface in calls.items())),
        "write": (
            *(key("cmd_vel", f"geometry_msgs/msg/{kind}") for kind in ROS_TWISTS),
            *(key(topic, POSE) for topic in settings.fixes.values()),
        ),
        "live": tuple(f"{names.LIVELINESS}/{domain}{'/*' * chunks}" for chunks in ROS_TOKENS),
    }


def publishing(services: Sequence[str]) -> dict[Verb, Sequence[str]]:
    """Return the rights to publish as these services: state, events, presence, replies."""
    telemetry = (keys.HEALTH, keys.SETTINGS)
    state = tuple(topic.on(ANY, service=name) for topic in telemetry for name in services)
    events = tuple(keys.EVENTS.on(ANY, service=name) for name in services)
    kept = tuple(f"{event}/{KEPT_KEY}" for event in events)
    return {
        "write": (*state, *events, *kept),
        "keep": events,
        "serve": (*(keys.info_key(ANY, name, ANY) for name in services), *kept),
        "live": (*(keys.live_key(ANY, name, ANY) for name in services), *kept),
    }


BUS = ("**", "**/@cmd/**", "**/@adv/**", f"{names.LIVELINESS}/**", "@/**")
ONBOARD: Rights = dict.fromkeys(VERBS, BUS)
