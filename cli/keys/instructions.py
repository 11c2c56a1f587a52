"""Instructions that ``t2 keys`` prints: the files that it wrote, and the next steps. Pure."""

from collections.abc import Iterator, Sequence

from cli.keys.machine_settings import MEMBERS, SETTINGS, connected, endpoints, ros_override
from cli.keys.member_list import EVERY_ROBOT
from cli.keys.members import OPERATORS_SOURCES, Member, Profile

PLACE = "/etc/t2/keys"  # on a router's machine, as in the systemd units and compose.yaml
IN_CONTAINERS = "docker compose restart router"
LATCHES = (
    "   The restart of a robot's router latches its vehicle: do it while the vehicle stands, then",
    "   look at it and reset (`t2 call safety/reset`); see docs/latches.md.",
)


def authority_created(folder: str, site: str, until: str) -> Iterator[str]:
    """Yield the instructions for a new authority."""
    yield f"{folder} holds the certificate authority of site {site}, until {until}. Back it up."
    yield f"Keep {folder}/ca.key secret: it can grant the right to drive to anyone. Next:"
    yield "  t2 keys issue robot 001"
    yield "  t2 keys issue driver NAME --robot 001"


def certificate_issued(member: Member, target: str, routers: Sequence[Profile]) -> Iterator[str]:
    """Yield the instructions for a new certificate: where to copy it, which routers to update."""
    yield f"{member.common_name}, valid until {member.expires:%Y-%m-%d}"
    yield from _rights(member)
    if member.listens:
        yield f"1. Copy the folder to the {member.role}'s computer only, and restart its router:"
        yield f"     scp -rp {target}/. {_host(member)}:{PLACE}"
        yield f"     t2 router --config {PLACE}/{SETTINGS}"
        if member.role == "robot":
            yield from LATCHES
    else:
        yield f"1. Copy the folder {target} to {member.name}'s computer only. There:"
        folder = target.rpartition("/")[2]
        if member.role == "ros":
            override = ros_override(f"$PWD/{folder}", connected(member, routers)[0])
            yield "     export RMW_IMPLEMENTATION=rmw_zenoh_cpp"
            yield "     export ZENOH_CONFIG_OVERRIDE=" + '"' + override.replace('"', '\\"') + '"'
        else:
            yield f"     t2 doctor --config {folder}/{SETTINGS}"
    others = [each for each in routers if each.label != member.label]
    if others or not member.listens:  # a router's own folder holds the list
        yield from _update_routers("2. ", target, others)


def _rights(member: Member) -> Iterator[str]:
    """Yield what a certificate is valid for."""
    if member.listens:
        yield f"  addresses {', '.join(member.addresses)}; valid at no other address"
    elif member.robots:
        robots = ", ".join(member.robots).replace(EVERY_ROBOT, "all")
        as_sources = f" as {' or '.join(member.sources)} only" if member.sources else ""
        yield f"  for robots {robots}{as_sources}"
        if member.sources and set(OPERATORS_SOURCES).isdisjoint(member.sources):
            yield "  may not reset, release or set the brake switches: no operator's source"
    if not member.listens and member.role != "ros":
        yield f"  may publish keys of its own: app/{member.name}/**"


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
    if any(member.listens for member in members):
        yield "Clients still accept the certificate of a stolen router: see SECURITY.md."


def _update_routers(number: str, target: str, routers: Sequence[Profile]) -> Iterator[str]:
    """Yield the steps that bring the new list to the routers."""
    folder = target.rpartition("/")[0] or "."
    yield f"{number}Copy {folder}/{MEMBERS} to each router and restart it:"
    for router in routers:
        copy = f"scp -p {folder}/{MEMBERS} {_host(router)}:{PLACE}/{MEMBERS}"
        yield f"     {copy}  # {router.role} {router.name}"
    if any(router.role == "robot" for router in routers):
        yield from LATCHES
    yield f"   A router in a container needs `{IN_CONTAINERS}` instead."


def _host(router: Profile) -> str:
    """Return the host of a router, for scp."""
    return endpoints([router])[0].removeprefix("tls/").rpartition(":")[0]
