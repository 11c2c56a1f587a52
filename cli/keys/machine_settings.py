"""What goes to a certificate's machine: the settings that use it, and what its user does. Pure.

The paths in ``bus.toml`` are relative to it, so that the folder works wherever it is put.
"""

import json
from collections.abc import Sequence

from cli.keys.profile import EVERY_ROBOT, LOCAL, VEHICLE, Profile

PORT = 7447
SOCKET = "unixsock-stream//run/t2/bus.sock"  # for those on board, trusted by file permission
ANYWHERE = f"tls/0.0.0.0:{PORT}"
CA, CERTIFICATE, PRIVATE_KEY = "ca.pem", "certificate.pem", "private.key"
MEMBERS, SETTINGS = "members.json", "bus.toml"


def bus_toml(profile: Profile, routers: Sequence[Profile]) -> str:
    """Return the settings of a machine; ``routers`` are those that there are certificates for."""
    site = [router for router in routers if router.role == "site"]
    lines = [f"# How {profile.role} {profile.name} gets on the bus; `t2 keys` made it.", ""]
    if len(profile.robots) == 1 and EVERY_ROBOT not in profile.robots:
        lines += ["[robot]", _line("id", profile.robots[0]), ""]
    lines += ["[bus]"]
    if not profile.listens:
        lines += _dialled(endpoints(site or _driven(profile, routers)))
    else:
        lines += [_line("listen", [SOCKET, ANYWHERE]), _line("members", MEMBERS)]
    if profile.role == "robot" and site:
        lines += [_line("uplink", endpoints(site)[:1])]
    lines += [_line("ca", CA), _line("certificate", CERTIFICATE), _line("private_key", PRIVATE_KEY)]
    lines += _driven_as(profile)
    return "\n".join(lines) + "\n"


def endpoints(routers: Sequence[Profile]) -> list[str]:
    """Return where routers are dialled from elsewhere, or on this host if they say no more."""
    found = [
        f"tls/{f'[{address}]' if ':' in address else address}:{PORT}"
        for router in routers
        for address in router.addresses
        if address not in LOCAL
    ]
    return found or [f"tls/{LOCAL[0]}:{PORT}"]


def _driven_as(profile: Profile) -> list[str]:
    """Return the source of each screen whose own name this certificate may not use."""
    if not profile.sources:
        return []
    shipped = {"teleop": "teleop", "dashboard": "web"}
    return [
        line
        for section, source in shipped.items()
        if source not in profile.sources
        for line in ("", f"[{section}]", _line("source", profile.sources[0]))
    ]


def _dialled(found: Sequence[str]) -> list[str]:
    """Return one endpoint to dial: Zenoh waits for the first, and never gets to a second."""
    line = _line("connect", list(found[:1]))
    return [line, *(f"# or: {_line('connect', [other])}" for other in found[1:])]


def _driven(profile: Profile, routers: Sequence[Profile]) -> list[Profile]:
    """Return the robots' routers that somebody has business with; the manual's if none is known."""
    any_robot = not profile.robots or EVERY_ROBOT in profile.robots
    return [router for router in routers if any_robot or router.name in profile.robots] or [
        Profile("robot", "", addresses=VEHICLE)
    ]


def _line(name: str, value: str | list[str]) -> str:
    return f"{name} = {json.dumps(value)}"
