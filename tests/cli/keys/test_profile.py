"""Profiles and validity of certificates."""

from collections.abc import Sequence
from typing import cast

import pytest

from cli.keys.profile import (
    CA_DAYS,
    DAY_S,
    DAYS,
    EARLY_S,
    LISTENERS,
    LOCAL,
    VEHICLE,
    Profile,
    profile,
    span,
)
from common.errors import ConfigError, RobotError
from common.members import ROLES, Role


def test_default_addresses_of_a_robot() -> None:
    assert profile("robot", "001", (), ()) == Profile("robot", "001", ("001",), VEHICLE + LOCAL)
    custom = profile("robot", "001", (), ("robot.example", "fd00::1", "robot.example"))
    assert custom.addresses == ("robot.example", "fd00::1", *LOCAL)


def test_addresses_of_a_site() -> None:
    assert profile("site", "berlin", (), ("10.0.0.1", "localhost")).addresses == (
        "10.0.0.1", "localhost", "127.0.0.1",
    )  # fmt: skip


def test_robots_of_a_driver() -> None:
    driver = profile("driver", "anna", ("001", "002", "001"), ())
    assert driver == Profile("driver", "anna", ("001", "002"), ())
    assert profile("driver", "anna", ("*",), ()).robots == ("*",)


def test_valid_sources_of_a_driver() -> None:
    assert profile("driver", "anna", ("001",), ()).sources == ()
    nav = profile("driver", "planner", ("001",), (), ("nav", "nav-2", "nav"))
    assert nav.sources == ("nav", "nav-2")
    assert nav.name == "planner"


@pytest.mark.parametrize("source", ["", "*", "Nav", "nav/x", "1nav", "n" * 33, "nav\n", "**"])
def test_invalid_sources(source: str) -> None:
    with pytest.raises(ConfigError, match="is not a source name"):
        profile("driver", "anna", ("001",), (), (source,))


def test_the_longest_source() -> None:
    assert profile("driver", "anna", ("001",), (), ("n" * 32,)).sources == ("n" * 32,)


def test_sources_are_for_drivers() -> None:
    with pytest.raises(ConfigError, match="--source is for drivers and devices; a viewer"):
        profile("viewer", "hall", (), (), ("nav",))
    with pytest.raises(ConfigError, match="--source is for drivers and devices; a ros"):
        profile("ros", "laptop", ("001",), (), ("ros2",))


@pytest.mark.parametrize("role", ROLES)
def test_routers_listen(role: Role) -> None:
    assert Profile(role, "x").listens is (role in LISTENERS)


@pytest.mark.parametrize(
    ("role", "name", "robots", "addresses", "message"),
    [
        ("driver", "anna", (), (), "a driver needs --robot ID"),
        ("viewer", "guest", ("001",), (), "are for drivers, devices and ros, not for a viewer"),
        ("robot", "001", ("002",), (), "are for drivers, devices and ros, not for a robot"),
        ("ros", "laptop", (), (), "a ros needs --robot ID"),
        ("fleet", "control", (), ("10.0.0.1",), "a fleet only connects"),
        ("site", "berlin", (), (), "a site's router needs --address"),
        ("driver", "../anna", ("001",), (), "'../anna' is not a name"),
        ("driver", "", ("001",), (), "'' is not a name"),
        ("driver", "a" * 49, ("001",), (), "is not a name"),
        ("driver", "anna", ("0 1",), (), "'0 1' is not a name"),
        ("driver", "anna\n", ("001",), (), "'anna\\n' is not a name"),
    ],
)
def test_invalid_profiles(
    role: str, name: str, robots: Sequence[str], addresses: Sequence[str], message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        profile(cast(Role, role), name, robots, addresses)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "address", ["robot", "robot-1", "r1.lan", "xn--bcher-kva.example", "10.7.5.220", "fd00::1"]
)
def test_addresses(address: str) -> None:
    assert profile("site", "x", (), (address,)).addresses[0] == address


@pytest.mark.parametrize(
    "address",
    ["", "300.1.1.1", "10.7.5", "a b", "-a.example", "a..b", "a.", "tls/a", "a:7447", "*.a.example",
     "a" * 64, "a\n", ".".join(["a" * 63] * 4)],
)  # fmt: skip
def test_invalid_addresses(address: str) -> None:
    with pytest.raises(ConfigError, match="is neither an IP address nor a host name"):
        profile("site", "x", (), (address,))


def test_the_common_name_ends_with_the_start_of_the_serial() -> None:
    who = Profile("driver", "anna")
    assert who.common_name(0x3F2A91BC << 128) == "driver.anna.3f2a91bc"
    assert who.common_name(1 << 128) == "driver.anna.00000001"


def test_every_common_name_is_short_enough_for_a_certificate() -> None:
    longest = max(len(Profile(role, "a" * 48).common_name(1)) for role in ROLES)
    assert longest <= 64  # RFC 5280, ub-common-name


def test_validity_of_a_certificate() -> None:
    now_s = 1e9
    valid = span(now_s, DAYS, now_s + CA_DAYS * DAY_S)
    assert valid.begins_s == now_s - EARLY_S
    assert valid.ends_s == now_s + 365 * DAY_S


@pytest.mark.parametrize("days", [0, -1, 11])
def test_a_certificate_never_exceeds_the_authority(days: int) -> None:
    assert span(0.0, 10, 10.5 * DAY_S).ends_s == 10 * DAY_S
    with pytest.raises(ConfigError, match=rf"--days {days}: allowed is 1..10, the remaining"):
        span(0.0, days, 10.5 * DAY_S)


@pytest.mark.parametrize("left_s", [DAY_S - 1, 0, -1])
def test_an_expired_authority_signs_nothing(left_s: int) -> None:
    with pytest.raises(RobotError, match="the CA has expired"):
        span(1e9, 1, 1e9 + left_s)
