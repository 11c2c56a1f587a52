"""The list of members as it is changed: who has a certificate, and who is struck off. Pure."""

from collections.abc import Sequence

from msgspec.structs import replace

from cli.keys.profile import LISTENERS, Profile
from common.errors import RobotError
from common.members import Member, Members, Role


def of(members: Members, role: Role, name: str) -> tuple[Member, ...]:
    """Return somebody's certificates that are not revoked, oldest first."""
    return tuple(each for each in members.welcome if (each.role, each.name) == (role, name))


def newest(members: Members, role: Role, name: str) -> Member:
    """Return somebody's last certificate; raise ``RobotError`` when there is none to renew."""
    found = of(members, role, name)
    if not found:
        raise RobotError(
            f"{role} {name} has no certificate, or a revoked one; "
            f"`t2 keys issue {role} {name}` makes one"
        )
    return found[-1]


def found_at(member: Member) -> tuple[str, ...]:
    """Return where somebody is dialled; raise ``RobotError`` for a router of whom no list says."""
    if member.role in LISTENERS and not member.addresses:
        who = f"{member.role} {member.name}"
        raise RobotError(
            f"the list does not say where {who} is found, and its certificate has to; "
            f"`t2 keys renew {who} --address HOST` says so"
        )
    return member.addresses


def routers(members: Members) -> list[Profile]:
    """Return the routers that are let in, each where its newest certificate says that it is."""
    last = {(each.role, each.name): each for each in members.welcome if each.role in LISTENERS}
    return [Profile(*who, addresses=last[who].addresses) for who in sorted(last)]


def check_free(members: Members, role: Role, name: str, now_s: float) -> None:
    """Raise ``RobotError`` when somebody of that name has a certificate that is still good."""
    good = [each for each in of(members, role, name) if each.expires.timestamp() > now_s]
    if good:
        raise RobotError(
            f"{role} {name} has a certificate until {good[-1].expires:%Y-%m-%d}; "
            f"`t2 keys renew {role} {name}` makes another, `revoke` takes it away"
        )


def added(members: Members, member: Member) -> Members:
    """Return the list with one more."""
    return replace(members, members=(*members.members, member))


def revoked(
    members: Members, role: Role, name: str, serial: str | None
) -> tuple[Members, Sequence[Member]]:
    """Return the list without somebody's certificates, or that one alone, and what was struck."""
    ends = "" if serial is None else f".{serial}"
    struck = [each for each in of(members, role, name) if each.common_name.endswith(ends)]
    if not struck:
        with_serial = "" if serial is None else f" with the serial {serial!r}"
        raise RobotError(f"{role} {name} has no certificate{with_serial} that could be revoked")
    left = tuple(
        replace(each, revoked=True) if each in struck else each for each in members.members
    )
    return replace(members, members=left), struck
