"""The content of a certificate by role. Pure.

Routers of robots and sites listen: their certificates hold addresses and are valid for both ends of
a link. All other members only connect, and their certificates are not valid for a router.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Annotated

import msgspec
from msgspec import Meta

from common.errors import ConfigError, RobotError
from common.members import OPERATORS_SOURCES, Role
from common.settings import Name, SourceName

DAY_S = 86_400
CA_DAYS = 3650
DAYS = 365
EARLY_S = DAY_S  # valid from a day ago: clocks differ, and a wrong time zone is up to 14 h

BOUND: tuple[Role, ...] = ("driver", "device", "ros")  # to robots
SOURCED: tuple[Role, ...] = ("driver", "device")  # to sources
LISTENERS: tuple[Role, ...] = ("robot", "site")
LOCAL = ("localhost", "127.0.0.1")  # for clients on the same host, or through a tunnel
VEHICLE = ("192.168.201.1", "10.7.5.220")  # on its own Wi-Fi and on its cable (manual 1 and 1.1)
EVERY_ROBOT = "*"
LONGEST = 48  # of a name: a common name has 64 characters (RFC 5280), ours role and serial too
NAMES = f"1 to {LONGEST} letters, digits, dots, hyphens and underscores"
SOURCE_NAMES = (
    "a lowercase letter, then up to 31 lowercase letters, digits, hyphens and underscores, as in "
    "safety.sources and safety.limits"
)

LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
HOST = re.compile(rf"(?=.{{1,253}}\Z)(?!(.*\.)?\d+\Z)({LABEL}\.)*{LABEL}\Z")  # no 300.1.1.1


@dataclass(frozen=True, slots=True)
class Profile:
    """The member that a certificate is for."""

    role: Role
    name: str
    robots: tuple[str, ...] = ()  # ids: of a driver, device or ros, or the robot
    addresses: tuple[str, ...] = ()  # IP addresses and host names of a router
    sources: tuple[str, ...] = ()  # of a driver or device; empty: any of a driver

    @property
    def label(self) -> str:
        """Return role and name, also the name of its folder."""
        return f"{self.role}.{self.name}"

    @property
    def listens(self) -> bool:
        """Return whether the member is a router."""
        return self.role in LISTENERS

    def common_name(self, serial: int) -> str:
        """Return a unique name: access is granted and revoked by it."""
        return f"{self.label}.{serial:040x}"[: len(self.label) + 9]


@dataclass(frozen=True, slots=True)
class Span:
    """Validity of a certificate, in seconds since 1970."""

    begins_s: float
    ends_s: float


def profile(
    role: Role,
    name: str,
    robots: Sequence[str],
    addresses: Sequence[str],
    sources: Sequence[str] = (),
) -> Profile:
    """Return the profile for the given options; raise ``ConfigError`` if they are invalid."""
    for each in (name, *(robot for robot in robots if robot != EVERY_ROBOT)):
        _check(each, Annotated[Name, Meta(max_length=LONGEST)], f"{each!r} is not a name: {NAMES}")
    for address in addresses:
        if not is_ip(address) and not HOST.match(address):
            raise ConfigError(f"--address {address!r} is neither an IP address nor a host name")
    _check_sources(role, robots, sources)
    if role not in LISTENERS and addresses:
        raise ConfigError(f"--address is for routers; a {role} only connects")
    if role == "site" and not addresses:
        raise ConfigError("a site's router needs --address: robots and laptops connect to it")
    if role == "robot":
        robots, addresses = (name,), addresses or VEHICLE
    all_addresses = unique(addresses and (*addresses, *LOCAL))
    return Profile(role, name, unique(robots), all_addresses, unique(sources))


def default_sources(role: Role, name: str) -> tuple[str, ...]:
    """Return the sources of a member for which none are given."""
    return {"driver": OPERATORS_SOURCES, "device": (name,)}.get(role, ())


def span(now_s: float, days: int, authority_ends_s: float) -> Span:
    """Return the validity of a new certificate; it never exceeds the authority's."""
    left = int((authority_ends_s - now_s) // DAY_S)
    if left < 1:
        raise RobotError(
            "the CA has expired; `t2 keys init --folder NEW` creates another, and every "
            "certificate must be issued again"
        )
    if not 1 <= days <= left:
        raise ConfigError(f"--days {days}: allowed is 1..{left}, the remaining validity of the CA")
    return Span(now_s - EARLY_S, now_s + days * DAY_S)


def unique(texts: Iterable[str]) -> tuple[str, ...]:
    """Return each text once, in order."""
    return tuple(dict.fromkeys(texts))


def is_ip(address: str) -> bool:
    """Return whether an address is an IP address, not a host name."""
    try:
        ip_address(address)
    except ValueError:
        return False
    return True


def _check(text: str, kind: object, problem: str) -> None:
    try:
        msgspec.convert(text, kind)
    except msgspec.ValidationError:
        raise ConfigError(problem) from None


def _check_sources(role: Role, robots: Sequence[str], sources: Sequence[str]) -> None:
    """Reject robots and sources for other roles, and a member without robots that needs one."""
    for source in sources:
        _check(source, SourceName, f"--source {source!r} is not a source name: {SOURCE_NAMES}")
    if role in BOUND and not robots:
        raise ConfigError(f"a {role} needs --robot ID for each of its robots, or --every")
    if role not in BOUND and robots:
        raise ConfigError(f"--robot and --every are for drivers, devices and ros, not for a {role}")
    if role not in SOURCED and sources:
        raise ConfigError(f"--source is for drivers and devices; a {role} uses no source")
