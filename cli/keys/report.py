"""Output of ``t2 keys list``: certificates with their state, and due renewals. Pure."""

from collections.abc import Iterator, Sequence
from typing import Literal

from cli.inspect import output
from cli.keys.profile import DAY_S, DAYS, EVERY_ROBOT
from common.members import Member, Members

SOON_DAYS = 30
HEAD = ("role", "name", "robots", "until", "state", "certificate")

State = Literal["valid", "expires soon", "expired", "revoked"]


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
    for member in last_of_each(members.welcome):
        if state(member, now_s) in ("expires soon", "expired"):
            name = f"{member.role} {member.name}"
            left = days(member.expires.timestamp(), now_s)
            yield f"{name} {_expiry(left)}: `t2 keys renew {name}`"


def last_of_each(members: Sequence[Member]) -> Sequence[Member]:
    """Return the latest certificate of each member."""
    return list({(member.role, member.name): member for member in members}.values())


def robots(member: Member) -> str:
    """Return the robots of a member as text."""
    return "every" if EVERY_ROBOT in member.robots else " ".join(member.robots) or "-"


def days(ends_s: float, now_s: float) -> int:
    """Return the number of whole days left; negative after the expiry."""
    return int((ends_s - now_s) // DAY_S)


def _expiry(left: int) -> str:
    return f"expires in {left} days" if left >= 0 else "has expired"
