"""Changes of the member list: lookup, addition, revocation. Pure."""

from collections.abc import Sequence

from msgspec.structs import replace

from cli.keys.profile import LISTENERS, Profile
from common.errors import RobotError
from common.members import Member, Members, Role


def of(members: Members, role: Role, name: str) -> tuple[Member, ...]:
    """Return the certificates of a member that are not revoked, oldest first."""
    return tuple(each for each in members.welcome if (each.role, each.name) == (role, name))


def newest(members: Members, role: Role, name: str) -> Member:
    """Return the latest certificate of a member; raise ``RobotError`` without one."""
    found = of(members, role, name)
    if not found:
        raise RobotError(
            f"{role} {name} has no certificate, or a revoked one; "
            f"`t2 keys issue {role} {name}` makes one"
        )
    return found[-1]


def addresses_of(member: Member) -> tuple[str, ...]:
    """Return the addresses of a member; raise ``RobotError`` for a router without any."""
    if member.role in LISTENERS and not member.addresses:
        name = f"{member.role} {member.name}"
        raise RobotError(
            f"the member list has no address of {name}; its certificate needs one: "
            f"`t2 keys renew {name} --address HOST`"
        )
    return member.addresses


def routers(members: Members) -> list[Profile]:
    """Return the admitted routers, each with the addresses of its latest certificate."""
    last = {(each.role, each.name): each for each in members.welcome if each.role in LISTENERS}
    return [Profile(*who, addresses=last[who].addresses) for who in sorted(last)]


def check_free(members: Members, role: Role, name: str, now_s: float) -> None:
    """Raise ``RobotError`` if a member of that name has a valid certificate."""
    good = [each for each in of(members, role, name) if each.expires.timestamp() > now_s]
    if good:
        raise RobotError(
            f"{role} {name} has a certificate until {good[-1].expires:%Y-%m-%d}; "
            f"`t2 keys renew {role} {name}` makes another, `revoke` revokes it"
        )


def added(members: Members, member: Member) -> Members:
    """Return the list with a new member."""
    return replace(members, members=(*members.members, member))


def revoked(
    members: Members, role: Role, name: str, serial: str | None
) -> tuple[Members, Sequence[Member]]:
    """Return the list with revoked certificates of a member, and the revoked ones."""
    ends = "" if serial is None else f".{serial}"
    matching = [each for each in of(members, role, name) if each.common_name.endswith(ends)]
    if not matching:
        with_serial = "" if serial is None else f" with the serial {serial!r}"
        raise RobotError(f"{role} {name} has no certificate{with_serial} that could be revoked")
    left = tuple(
        replace(each, revoked=True) if each in matching else each for each in members.members
    )
    return replace(members, members=left), matching
