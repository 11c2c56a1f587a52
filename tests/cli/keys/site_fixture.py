"""Members of a small site at a fixed time."""

from datetime import UTC, datetime, timedelta
from typing import Any

from msgspec.structs import asdict

from cli.keys.members import Member, Members, Profile, Role

NOW = datetime(2026, 11, 21, 12, tzinfo=UTC)
NOW_S = NOW.timestamp()


def member(
    role: Role,
    name: str,
    serial: str = "00000001",
    days: float = 300,
    *,
    revoked: bool = False,
    **fields: Any,
) -> Member:
    """Return a member whose certificate is valid for so many days."""
    robots = {"robots": ("001",) if role in ("driver", "robot") else ()}
    who = Profile(role=role, name=name, **(robots | fields))
    return certified(who, serial, days, revoked=revoked)


def certified(
    who: Profile, serial: str = "00000001", days: float = 300, *, revoked: bool = False
) -> Member:
    """Return the member with a certificate for this profile."""
    return Member(
        **asdict(who),
        common_name=f"{who.label}.{serial}",
        expires=NOW + timedelta(days=days),
        revoked=revoked,
    )


def members(*each: Member) -> Members:
    """Return the member list."""
    return Members(site="berlin", members=each)
