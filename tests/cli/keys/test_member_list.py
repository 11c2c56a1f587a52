"""Changes of the member list, and the output of ``t2 keys list``."""

import msgspec
import pytest

from cli.keys import member_list
from cli.keys.profile import DAY_S
from common.errors import RobotError
from common.members import Member, Members
from tests.cli.keys.site_fixture import NOW_S, member, members

OLD = member("driver", "anna", "00000001", 10)
NEW = member("driver", "anna", "00000002")
GONE = member("driver", "anna", "00000003", revoked=True)
OTHER = member("driver", "ann", "00000001")
SAME_NAME = member("viewer", "anna")
LONG_S = NOW_S + 3000 * DAY_S
SITE = members(OLD, NEW, GONE, OTHER, SAME_NAME)


def test_newest_skips_revoked_certificates() -> None:
    assert member_list.newest(SITE, "driver", "anna") is NEW


@pytest.mark.parametrize("there", [members(), members(GONE, OTHER, SAME_NAME)])
def test_nothing_to_renew(there: Members) -> None:
    with pytest.raises(RobotError, match="driver anna has no certificate, or a revoked one"):
        member_list.newest(there, "driver", "anna")


def test_a_name_is_free_without_a_valid_certificate() -> None:
    ended = member("driver", "anna", days=-1)
    member_list.check_free(members(ended, GONE, OTHER, SAME_NAME), "driver", "anna", NOW_S)
    with pytest.raises(RobotError, match=r"has a certificate until 2027-09-17; `t2 keys renew dri"):
        member_list.check_free(SITE, "driver", "anna", NOW_S)


def test_routers_have_the_addresses_of_their_latest_certificate() -> None:
    old, new = (member("robot", "002", serial, addresses=(where,))
                for serial, where in (("1", "10.0.0.1"), ("2", "10.0.0.2")))  # fmt: skip
    gone, of_before = member("robot", "003", revoked=True), member("robot", "001")
    site = member("site", "berlin", addresses=("site.example",))
    found = member_list.routers(members(site, old, new, gone, of_before, OLD))
    assert [(each.label, each.addresses) for each in found] == [
        ("robot.001", ()), ("robot.002", ("10.0.0.2",)), ("site.berlin", ("site.example",)),
    ]  # fmt: skip


def test_a_router_without_addresses_is_an_error() -> None:
    assert member_list.addresses_of(member("robot", "002", addresses=("10.0.0.1",))) == (
        "10.0.0.1",
    )
    assert member_list.addresses_of(NEW) == ()
    with pytest.raises(RobotError, match=r"no address of robot 002.*`t2 keys renew robot 002 "):
        member_list.addresses_of(member("robot", "002"))


def test_added() -> None:
    assert member_list.added(members(OLD), NEW) == members(OLD, NEW)


def test_revoke_all_certificates_of_a_member() -> None:
    left, revoked = member_list.revoked(SITE, "driver", "anna", None)
    assert revoked == [OLD, NEW]
    assert [each.common_name for each in left.welcome] == [
        "driver.ann.00000001",
        "viewer.anna.00000001",
    ]
    assert len(left.members) == len(SITE.members)


def test_revoke_one_certificate_of_a_member() -> None:
    left, revoked = member_list.revoked(SITE, "driver", "anna", "00000001")
    assert revoked == [OLD]
    assert left.welcome == (NEW, OTHER, SAME_NAME)


@pytest.mark.parametrize(
    ("name", "serial", "message"),
    [
        ("ben", None, "driver ben has no certificate that could be revoked"),
        ("anna", "00000003", "has no certificate with the serial '00000003' that could be"),
        ("anna", "1", "has no certificate with the serial '1' that could be"),
        ("anna", "", "has no certificate with the serial '' that could be"),
    ],
)
def test_nothing_to_revoke(name: str, serial: str | None, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        member_list.revoked(SITE, "driver", name, serial)


# --- t2 keys list ---------------------------------------------------------------------------------


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
    assert member_list.state(who, NOW_S) == expected


def test_the_table() -> None:
    every = msgspec.structs.replace(
        member("driver", "ben", "00000002"), robots=("*",), sources=("nav", "web")
    )
    site = members(member("driver", "anna"), every, member("viewer", "guest", days=-1))
    assert member_list.as_table(site, NOW_S).splitlines() == [
        "role    name   robots  sources       until  state    certificate",
        "driver  anna   001     any      2027-09-17  valid    driver.anna.00000001",
        "driver  ben    every   nav web  2027-09-17  valid    driver.ben.00000002",
        "viewer  guest  -       -        2026-11-20  expired  viewer.guest.00000001",
    ]


def test_for_programs() -> None:
    assert member_list.as_json(members(member("driver", "anna", days=12.5)), LONG_S, NOW_S) == {
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
    assert list(member_list.advice(site, LONG_S, NOW_S)) == [
        "driver anna expires in 12 days: `t2 keys renew driver anna`",
        "driver ben has expired: `t2 keys renew driver ben`",
    ]


def test_renewed_certificates_need_no_advice() -> None:
    site = members(member("driver", "anna", days=-2), member("driver", "anna", "00000002"))
    assert list(member_list.advice(site, LONG_S, NOW_S)) == []


@pytest.mark.parametrize(
    ("left", "message"),
    [(365, []), (364.5, ["the CA expires in 364 days"]), (-1, ["the CA has expired"])],
)
def test_advice_for_an_expiring_authority(left: float, message: list[str]) -> None:
    lines = list(member_list.advice(members(), NOW_S + left * DAY_S, NOW_S))
    assert [line.partition(":")[0] for line in lines] == message
