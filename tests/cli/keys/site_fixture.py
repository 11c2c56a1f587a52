"""Members of a small site at a fixed time."""

from datetime import UTC, datetime, timedelta

from common.members import Member, Members, Role

NOW = datetime(2026, 11, 21, 12, tzinfo=UTC)
NOW_S = NOW.timestamp()


def member(
    role: Role,
    name: str,
    serial: str = "00000001",
    days: float = 300,
    *,
    revoked: bool = False,
    addresses: tuple[str, ...] = (),
) -> Member:
    """Return a member whose certificate is valid for so many days."""
    return Member(
        common_name=f"{role}.{name}.{serial}", role=role, name=name,
        robots=("001",) if role in ("driver", "robot") else (), addresses=addresses,
        expires=NOW + timedelta(days=days), revoked=revoked,
    )  # fmt: skip


def members(*each: Member) -> Members:
    """Return the member list."""
    return Members(site="berlin", members=each)
