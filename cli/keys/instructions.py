"""Instructions that ``t2 keys`` prints: the files that it wrote, and the next steps. Pure."""

from collections.abc import Iterator, Sequence

from cli.keys.machine_settings import MEMBERS, SETTINGS, connected, endpoints, ros_override
from cli.keys.member_list import EVERY_ROBOT
from common.members import OPERATORS_SOURCES, Member, Profile, Role

PLACE = "/etc/t2/keys"  # on a router's machine, as in the systemd units and compose.yaml
# A container's router starts with generated rules: they must be generated again first.
IN_CONTAINERS = "docker compose up -d --force-recreate router-settings router"
USED_BY: dict[Role, str] = {
    "robot": "router",
    "site": "router",
    "driver": "drive",
    "device": "doctor",
    "viewer": "dashboard",
    "fleet": "robots",
}


def authority_created(folder: str, site: str, until: str, encrypted: bool) -> Iterator[str]:
    """Yield the instructions for a new authority."""
    yield f"{folder} holds the certificate authority of site {site}, until {until}."
    protection = "it is encrypted" if encrypted else "it is not encrypted"
    yield f"Keep {folder}/ca.key secret: it can grant the right to drive to anyone ({protection})."
    yield "  Keep it on this computer, or on a removable medium (--ca-key FILE)."
    yield "Back up the folder. Next:"
    yield "  t2 keys issue robot 001"
    yield "  t2 keys issue driver NAME --robot 001"


def certificate_issued(member: Member, target: str, routers: Sequence[Profile]) -> Iterator[str]:
    """Yield the instructions for a new certificate: where to copy it, which routers to update."""
    yield f"{member.common_name}, valid until {member.expires:%Y-%m-%d}"
    if member.listens:
        yield f"  addresses {', '.join(member.addresses)}; valid at no other address"
    if member.role in ("driver", "ros"):
        yield f"  may move {_robots(member)}"
    if member.sources:
        verb = "drives" if member.role == "driver" else f"limits {_robots(member)}"
        yield f"  {verb} as {' or '.join(member.sources)}; no other source is allowed"
        if set(OPERATORS_SOURCES).isdisjoint(member.sources):
            yield "  may not reset, release or set the brake switches: no operator's source"
    yield ""
    if member.listens:
        yield f"1. Copy the folder to the {member.role}'s computer only:"
        yield f"     scp -rp {target}/. {_host(member)}:{PLACE}"
        yield "2. There, give the files to the user that runs the router, and restart it:"
        yield f"     t2 router --config {PLACE}/{SETTINGS}"
    else:
        yield f"1. Copy the folder {target} to {member.name}'s computer only."
        yield "2. On that computer:"
        yield from _use(member, target, routers)
    others = [each for each in routers if each.label != member.label]
    if others or not member.listens:  # a router's own folder holds the list
        yield from _update_routers("3. ", target, others)


def certificate_renewed(old: Member) -> Iterator[str]:
    """Yield the instructions for the previous certificate."""
    serial = old.common_name.rpartition(".")[2]
    yield f"The previous one stays valid until {old.expires:%Y-%m-%d}. Once the new one is in use:"
    yield f"     t2 keys revoke {old.role} {old.name} --serial {serial}"


def certificates_revoked(
    members: Sequence[Member], target: str, routers: Sequence[Profile]
) -> Iterator[str]:
    """Yield the instructions after a revocation: it takes effect at the routers."""
    for member in members:
        yield f"{member.common_name} is revoked"
    yield "The revocation takes effect when every router has the new list:"
    yield from _update_routers("", target, routers)
    if any(member.role in ("robot", "site") for member in members):
        yield "Clients still accept the certificate of a stolen router: see SECURITY.md."


def _update_routers(number: str, target: str, routers: Sequence[Profile]) -> Iterator[str]:
    """Yield the steps that bring the new list to the routers."""
    folder = target.rpartition("/")[0] or "."
    if not routers:
        yield f"{number}Copy {folder}/{MEMBERS} to each router and restart it."
    else:
        yield f"{number}Copy {MEMBERS} to each router and restart it:"
    for router in routers:
        copy = f"scp -p {folder}/{MEMBERS} {_host(router)}:{PLACE}/{MEMBERS}"
        yield f"     {copy}  # {router.role} {router.name}"
    yield "   A router in a container needs this instead of a restart:"
    yield f"     {IN_CONTAINERS}"


def _use(profile: Profile, target: str, routers: Sequence[Profile]) -> Iterator[str]:
    if profile.role == "ros":
        override = ros_override(f"$PWD/{_last(target)}", connected(profile, routers)[0])
        yield "     export RMW_IMPLEMENTATION=rmw_zenoh_cpp"
        yield "     export ZENOH_CONFIG_OVERRIDE=" + '"' + override.replace('"', '\\"') + '"'
    else:
        yield f"     t2 {USED_BY[profile.role]} --config {_last(target)}/{SETTINGS}"


def _robots(profile: Profile) -> str:
    if EVERY_ROBOT in profile.robots:
        return "every robot"
    return ", ".join(f"robot {each}" for each in profile.robots)


def _host(router: Profile) -> str:
    """Return the host of a router, for scp."""
    return endpoints([router])[0].removeprefix("tls/").rpartition(":")[0]


def _last(path: str) -> str:
    return path.rpartition("/")[2]
