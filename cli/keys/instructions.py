"""What ``t2 keys`` says after it has done something: what lies where, and what to do next. Pure."""

from collections.abc import Iterator, Sequence

from cli.keys.machine_settings import MEMBERS, SETTINGS, endpoints
from cli.keys.profile import EVERY_ROBOT, Profile
from common.members import Member, Role

PLACE = "/etc/t2/keys"  # on a machine that runs a router; the units and compose.yaml look there
UNKNOWN = "; where it is, the list does not say"
# A container's router starts with the rules that were made for it, so these are made anew first.
IN_CONTAINERS = "docker compose up -d --force-recreate router-settings router"
USED_BY: dict[Role, str] = {
    "robot": "router",
    "site": "router",
    "driver": "drive",
    "viewer": "dashboard",
    "fleet": "robots",
}


def founded(folder: str, site: str, until: str, encrypted: bool) -> Iterator[str]:
    """Say what a new authority is."""
    yield f"{folder} holds the certificate authority of site {site}, until {until}."
    protection = "with its passphrase" if encrypted else "it has no passphrase"
    yield f"Whoever has {folder}/ca.key can make a driver of anybody ({protection}):"
    yield "  it stays on this computer, or on a medium that is taken out (--ca-key FILE)."
    yield "Back up the folder. Next:"
    yield "  t2 keys issue robot 001"
    yield "  t2 keys issue driver NAME --robot 001"


def issued(
    profile: Profile, member: Member, target: str, routers: Sequence[Profile]
) -> Iterator[str]:
    """Say what was made, where it goes, and who has to learn of it."""
    yield f"{member.common_name}, until {member.expires:%Y-%m-%d}"
    if profile.listens:
        yield f"  found at {', '.join(profile.addresses)}; no other address is believed"
    if profile.role == "driver":
        yield f"  may move {_robots(profile)}"
    if profile.sources:
        yield f"  drives as {' or '.join(profile.sources)}; no other source is allowed"
    yield ""
    if profile.listens:
        yield f"1. Copy the folder to the {profile.role}'s computer, and to no other:"
        yield f"     scp -rp {target}/. {_host(profile)}:{PLACE}"
        yield "2. There, all that is in it belongs to the user who runs the router. Start it anew:"
        yield f"     t2 router --config {PLACE}/{SETTINGS}"
    else:
        yield f"1. Copy the folder {target} to {profile.name}'s computer, and to no other."
        yield "2. There:"
        yield f"     t2 {USED_BY[profile.role]} --config {_last(target)}/{SETTINGS}"
    others = [each for each in routers if each.who != profile.who]
    if others or not profile.listens:  # a router's own folder holds the list
        yield from _spread("3. ", target, others)


def renewed(role: Role, name: str, old: Member) -> Iterator[str]:
    """Say what becomes of the one before."""
    serial = old.common_name.rpartition(".")[2]
    yield f"The one before stays good until {old.expires:%Y-%m-%d}. Once the new one is in use:"
    yield f"     t2 keys revoke {role} {name} --serial {serial}"


def struck(members: Sequence[Member], target: str, routers: Sequence[Profile]) -> Iterator[str]:
    """Say what was revoked, and that this takes hold with the routers."""
    for member in members:
        yield f"{member.common_name} is revoked"
    yield "Until every router has the new list, nothing has changed:"
    yield from _spread("", target, routers)
    if any(member.role in ("robot", "site") for member in members):
        yield "A stolen router's certificate still looks good to who dials it: see SECURITY.md."


def _spread(number: str, target: str, routers: Sequence[Profile]) -> Iterator[str]:
    """Say how routers learn of a new list."""
    folder = target.rpartition("/")[0] or "."
    if not routers:
        yield f"{number}Each router wants {folder}/{MEMBERS} anew, and a restart."
    else:
        yield f"{number}Each router learns of it by {MEMBERS} and a restart:"
    for router in routers:
        host, unknown = (_host(router), "") if router.addresses else ("HOST", UNKNOWN)
        copy = f"scp -p {folder}/{MEMBERS} {host}:{PLACE}/{MEMBERS}"
        yield f"     {copy}  # {router.role} {router.name}{unknown}"
    yield "   In containers no restart does; there it is:"
    yield f"     {IN_CONTAINERS}"


def _robots(profile: Profile) -> str:
    if EVERY_ROBOT in profile.robots:
        return "every robot"
    return ", ".join(f"robot {each}" for each in profile.robots)


def _host(router: Profile) -> str:
    """Return how a router's computer is reached, for a copy."""
    return endpoints([router])[0].removeprefix("tls/").rpartition(":")[0]


def _last(path: str) -> str:
    return path.rpartition("/")[2]
