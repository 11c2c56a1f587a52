"""Output of ``t2 keys list``."""

import msgspec
import pytest

from cli.keys import report
from cli.keys.profile import DAY_S
from common.members import Member
from tests.cli.keys.site_fixture import NOW_S, member, members

LONG_S = NOW_S + 3000 * DAY_S


@pytest.mark.parametrize(
    ("who", "expected"),
    [
        (member("viewer", "a", days=30), "valid"),
        (member("viewer", "a", days=29.99), "expires soon"),
        (member("viewer", "a", days=0.01), "expires soon"),
        (member("viewer", "a", days=0), "expired"),
        (member("viewer", "a", days=-5), "expired"),
        (member("viewer", "a", days=300, revoked=True), "revoked"),
        (member("viewer", "a", days=-5, revoked=True), "revoked"),
    ],
)
def test_states(who: Member, expected: str) -> None:
    assert report.state(who, NOW_S) == expected


def test_the_table() -> None:
    every = msgspec.structs.replace(member("driver", "ben", "00000002"), robots=("*",))
    site = members(member("driver", "anna"), every, member("viewer", "guest", days=-1))
    assert report.as_table(site, NOW_S).splitlines() == [
        "role    name   robots       until  state    certificate",
        "driver  anna   001     2027-09-17  valid    driver.anna.00000001",
        "driver  ben    every   2027-09-17  valid    driver.ben.00000002",
        "viewer  guest  -       2026-11-20  expired  viewer.guest.00000001",
    ]


def test_for_programs() -> None:
    assert report.as_json(members(member("driver", "anna", days=12.5)), LONG_S, NOW_S) == {
        "site": "berlin",
        "authority": {"days": 3000},
        "certificates": [
            {
                "common_name": "driver.anna.00000001",
                "role": "driver",
                "name": "anna",
                "robots": ["001"],
                "sources": [],
                "expires": "2026-12-04T00:00:00Z",
                "days": 12,
                "state": "expires soon",
            }
        ],
    }


def test_advice_names_the_renewal_command() -> None:
    site = members(
        member("driver", "anna", days=12.5),
        member("driver", "ben", days=-1),
        member("viewer", "guest", days=31),
        member("viewer", "gone", days=3, revoked=True),
    )
    assert list(report.advice(site, LONG_S, NOW_S)) == [
        "driver anna expires in 12 days: `t2 keys renew driver anna`",
        "driver ben has expired: `t2 keys renew driver ben`",
    ]


def test_renewed_certificates_need_no_advice() -> None:
    site = members(member("driver", "anna", days=-2), member("driver", "anna", "00000002"))
    assert list(report.advice(site, LONG_S, NOW_S)) == []


@pytest.mark.parametrize(
    ("left", "message"),
    [(365, []), (364.5, ["the CA expires in 364 days"]), (-1, ["the CA has expired"])],
)
def test_advice_for_an_expiring_authority(left: float, message: list[str]) -> None:
    lines = list(report.advice(members(), NOW_S + left * DAY_S, NOW_S))
    assert [line.partition(":")[0] for line in lines] == message
