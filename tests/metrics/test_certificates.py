"""When certificates end, as `t2 keys` lists them."""

from datetime import UTC, datetime

import pytest

from common.members import Member, Members, Role
from services.metrics.certificates import ends

SOON, LATER = (datetime(2027, month, 1, tzinfo=UTC) for month in (1, 2))


def member(role: Role, name: str, expires: datetime, *, revoked: bool = False) -> Member:
    number = f"{expires:%m}"
    return Member(
        common_name=f"{role}.{name}.{number}", role=role, name=name, expires=expires,
        revoked=revoked,
    )  # fmt: skip


def listed(*members: Member) -> Members:
    return Members(site="berlin", members=members)


def test_each_member_has_an_end() -> None:
    made = listed(member("driver", "anna", SOON), member("robot", "001", LATER))
    assert ends(made) == {
        ("driver", "anna"): SOON.timestamp(),
        ("robot", "001"): LATER.timestamp(),
    }


@pytest.mark.parametrize("dates", [(SOON, LATER), (LATER, SOON)])
def test_of_a_renewed_one_the_last_end_counts(dates: tuple[datetime, datetime]) -> None:
    made = listed(*(member("driver", "anna", each) for each in dates))
    assert ends(made) == {("driver", "anna"): LATER.timestamp()}


def test_a_revoked_one_may_end() -> None:
    made = listed(member("driver", "anna", SOON), member("driver", "anna", LATER, revoked=True))
    assert ends(made) == {("driver", "anna"): SOON.timestamp()}
