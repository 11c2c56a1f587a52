"""Profiles, validity, changes of the member list, and the table of ``t2 keys list``."""

from contextlib import nullcontext
from typing import Any

import pytest

from cli.keys import member_list
from cli.keys.member_list import DAY_S, EARLY_S, LOCAL, VEHICLE, common_name, profile, span
from cli.keys.members import ROLES, Profile
from common.errors import ConfigError
from t2.errors import T2Error
from tests.cli.keys.site_fixture import NOW_S, member, members

# --- profiles -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "found"),
    [
        (("robot", "001"), {"robots": ("001",), "addresses": VEHICLE + LOCAL}),
        (("robot", "001", (), ("robot.example", "fd00::1", "robot.example")),
         {"robots": ("001",), "addresses": ("robot.example", "fd00::1", *LOCAL)}),
        (("site", "berlin", (), ("10.0.0.1", "localhost")),
         {"addresses": ("10.0.0.1", "localhost", "127.0.0.1")}),
        (("driver", "planner", ("001", "*", "001"), (), ("nav", "nav-2", "nav")),
         {"robots": ("001", "*"), "sources": ("nav", "nav-2")}),
    ],
)  # fmt: skip
def test_valid_profiles(given: tuple[Any, ...], found: dict[str, tuple[str, ...]]) -> None:
    assert profile(*given) == Profile(role=given[0], name=given[1], **found)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("driver", "anna"), "a driver needs --robot ID"),
        (("viewer", "guest", ("001",)), "is for drivers, devices and ros, not for a viewer"),
        (("fleet", "control", (), ("10.0.0.1",)), "a fleet only connects"),
        (("site", "berlin"), "a site's router needs --address"),
        (("driver", "../anna", ("001",)), "'../anna' is not a name"),
        (("driver", "anna", ("0 1",)), "'0 1' is not a name"),
        (("driver", "anna\n", ("001",)), "'anna\\n' is not a name"),
        (("viewer", "hall", (), (), ("nav",)), "--source is for drivers and devices; a viewer"),
        *((("driver", "anna", ("001",), (), (source,)), "is not a source name")
          for source in ("*", "n" * 33, "nav\n")),
        *((("site", "x", (), (address,)), "is neither an IP address nor a host name")
          for address in ("", "300.1.1.1", "a b", "-a.example", "a.", "a:7447", "*.a.example",
                          "a" * 64, "a\n", ".".join(["a" * 63] * 4))),
    ],
)  # fmt: skip
def test_invalid_profiles(given: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        profile(*given)
    assert message in str(caught.value)


def test_the_longest_common_name_is_valid() -> None:
    longest = max(len(common_name(Profile(role=role, name="a" * 48), 1)) for role in ROLES)
    assert longest <= 64  # RFC 5280, ub-common-name


@pytest.mark.parametrize(
    ("days", "left_days", "error"),
    [
        (10, 10.5, ""),
        (0, 10.5, "--days 0: allowed is 1..10, the remaining"),
        (11, 10.5, "--days 11: allowed is 1..10, the remaining"),
        (1, 0.99, "the CA has expired"),
        (1, -1, "the CA has expired"),
    ],
)
def test_a_certificate_never_exceeds_the_authority(days: int, left_days: float, error: str) -> None:
    with pytest.raises(T2Error, match=error) if error else nullcontext():
        assert span(1e9, days, 1e9 + left_days * DAY_S) == (1e9 - EARLY_S, 1e9 + days * DAY_S)


# --- the list -----------------------------------------------------------------------------------


def test_a_name_is_free_without_a_valid_certificate() -> None:
    ended, gone = member("driver", "anna", days=-1), member("driver", "anna", revoked=True)
    others = member("driver", "ann"), member("viewer", "anna")
    member_list.check_free(members(ended, gone, *others), "driver", "anna", NOW_S)


def test_routers_have_the_addresses_of_their_latest_certificate() -> None:
    old, new = (member("robot", "002", serial, addresses=(where,))
                for serial, where in (("1", "10.0.0.1"), ("2", "10.0.0.2")))  # fmt: skip
    gone, site = member("robot", "003", revoked=True), member("site", "berlin")
    driver = member("driver", "anna")
    assert member_list.routers(members(site, old, new, gone, driver)) == [new, site]


# --- t2 keys list ---------------------------------------------------------------------------------


def test_states() -> None:
    for days, expected in ((30, "valid"), (29.99, "expires soon"), (0, "expired")):
        assert member_list.state(member("viewer", "a", days=days), NOW_S) == expected
