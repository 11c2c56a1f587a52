"""The member list: lookup, addition, revocation, and the output of ``t2 keys list``. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from msgspec.structs import replace

from cli.inspect import output
from cli.keys.profile import DAY_S, DAYS, EVERY_ROBOT, LISTENERS, Profile
from common.errors import RobotError
from common.members import Member, Members, Role

SOON_DAYS = 30
HEAD = ("role", "name", "robots", "sources", "until", "state", "certificate")

State = Literal["valid", "expires soon", "expired", "revoked"]


def of(members: Members, role: Role, name: str) -> tuple[Member, ...]:
    """Return the certificates of a member that are not revoked, oldest first."""
    return tuple(each for each in members.welcome if (each.role, each.name) == (role, name))


def newest(members: Members, role: Role, name: str) -> Member:
    """Return the latest certificate of a member; raise ``RobotError`` without one."""
    found = newest_of_each(members).get((role, name))
    if found is None:
        raise RobotError(
            f"{role} {name} has no certificate, or a revoked one; "
            f"`t2 keys issue {role} {name}` makes one"
        )
    return found


def newest_of_each(members: Members) -> Mapping[tuple[Role, str], Member]:
    """Return the latest certificate of each admitted member, by role and name."""
    return {(member.role, member.name): member for member in members.welcome}


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
    newest = sorted(newest_of_each(members).items())
    return [Profile(*who, addresses=it.addresses) for who, it in newest if who[0] in LISTENERS]


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


def state(member: Member, now_s: float) -> State:
    """Return the state of a certificate."""
    if member.revoked:
        return "revoked"
    left_s = member.expires.timestamp() - now_s
    if left_s <= 0:
        return "expired"
    return "expires soon" if left_s < SOON_DAYS * DAY_S else "valid"


def as_table(members: Members, now_s: float) -> str:
    """Return a table with a row for each certificate."""
    rows = [
        (
            member.role,
            member.name,
            robots(member),
            sources(member),
            f"{member.expires:%Y-%m-%d}",
            state(member, now_s),
            member.common_name,
        )
        for member in members.members
    ]
    return output.table(HEAD, rows)


def as_json(members: Members, ca_ends_s: float, now_s: float) -> dict[str, object]:
    """Return the list as JSON fields."""
    return {
        "site": members.site,
        "authority": {"days": days(ca_ends_s, now_s)},
        "certificates": [
            {
                "common_name": member.common_name,
                "role": member.role,
                "name": member.name,
                "robots": list(member.robots),
                "sources": list(member.sources),
                "expires": f"{member.expires:%Y-%m-%dT%H:%M:%SZ}",
                "days": days(member.expires.timestamp(), now_s),
                "state": state(member, now_s),
            }
            for member in members.members
        ],
    }


def advice(members: Members, ca_ends_s: float, now_s: float) -> Iterator[str]:
    """Yield what expires, with the command to renew it; skip renewed certificates."""
    left = days(ca_ends_s, now_s)
    if left < DAYS:
        yield f"the CA {_expiry(left)}: create another with `t2 keys init --folder NEW`"
    for member in newest_of_each(members).values():
        if state(member, now_s) in ("expires soon", "expired"):
            name = f"{member.role} {member.name}"
            left = days(member.expires.timestamp(), now_s)
            yield f"{name} {_expiry(left)}: `t2 keys renew {name}`"


def robots(member: Member) -> str:
    """Return the robots of a member as text."""
    return "every" if EVERY_ROBOT in member.robots else " ".join(member.robots) or "-"


def sources(member: Member) -> str:
    """Return the sources of a member as text; a driver's certificate without any may use each."""
    if member.role == "driver" and not member.sources:
        return "any"
    return " ".join(member.sources) or "-"


def days(ends_s: float, now_s: float) -> int:
    """Return the number of whole days left; negative after the expiry."""
    return int((ends_s - now_s) // DAY_S)


def _expiry(left: int) -> str:
    return f"expires in {left} days" if left >= 0 else "has expired"
