"""Asks the bus who is there: liveliness tokens, and the router's admin space where it may be read.

The admin space is what the router knows, not what flows; a router without one, or one that does not
let us read it, leaves the tokens alone. What begins with ``@`` is not in it (eclipse-zenoh 1.10.2):
who commands is overheard instead.
"""

from typing import Any

from cli.inspect.graph import Edge, Member, by_boot, members, title
from cli.inspect.payload import read
from common import keys
from common.bus.probe import Probe

# A robot's router that dials a site's is a peer.
ADMIN = "@/*/*/*/t2/v1/{robot}/**"
ROUTER = "@/*/*"
OVERHEAR_S = 0.5
SOMEBODY = "somebody"  # the router knows a reader, and does not tell which


def present(probe: Probe, robot: str) -> list[Member]:
    """Return who is there, but for this tool itself."""
    tokens = probe.alive(keys.live_key(robot, "*", "*"))
    return members(tokens, declared(probe, robot), without=(probe.zid,))


def declared(probe: Probe, robot: str) -> dict[str, Any]:
    """Return the router's admin space of a robot's keys; empty where it is closed."""
    answers = probe.ask(ADMIN.format(robot=robot))
    return {
        each.key: read(each.payload, each.encoding).value for each in answers if not each.refusal
    }


def overhear(probe: Probe, robot: str, who: list[Member]) -> list[Edge]:
    """Add to each member the commands that it publishes, and return their ways."""
    boots, found = by_boot(who), set()
    probe.listen(f"{keys.ROOT}/{robot}/@cmd/**")
    for heard in probe.samples(OVERHEAR_S):
        value = read(heard.payload, heard.encoding).value
        boot = value.get("boot") if isinstance(value, dict) else None
        if boot not in boots:
            boots[boot] = Member(f"boot {boot}")
            who.append(boots[boot])
        boots[boot].publishes.add(heard.key)
        found.add((boot, heard.key))
    reader = {key: SOMEBODY for _, key in found if probe.has_reader(key)}
    return [Edge(title(boots[boot], who), key, reader[key]) for boot, key in found if key in reader]


def routers(probe: Probe) -> list[dict[str, Any]]:
    """Return what each router tells of itself; nothing where the admin space is closed."""
    told = (read(each.payload, each.encoding).value for each in probe.ask(ROUTER))
    return [each for each in told if isinstance(each, dict)]
