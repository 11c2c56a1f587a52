"""What a certificate holds, by the role of whom it is for. Pure.

The routers of a robot and of a site listen: their certificates say where they are found, and serve
both ends of a link. Everybody else only dials, and no certificate of theirs passes for a router's.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Annotated

import msgspec
from msgspec import Meta

from common.errors import ConfigError, RobotError
from common.members import Name, Role, SourceName

DAY_S = 86_400
CA_DAYS = 3650
DAYS = 365
EARLY_S = DAY_S  # valid from a day ago: clocks differ, and a wrong time zone is up to 14 h

LISTENERS: tuple[Role, ...] = ("robot", "site")
LOCAL = ("localhost", "127.0.0.1")  # for what runs on the same host, or comes through a tunnel
VEHICLE = ("192.168.201.1", "10.7.5.220")  # on its own Wi-Fi and on its cable (manual 1 and 1.1)
EVERY_ROBOT = "*"
OPERATORS_SOURCES = ("teleop", "web", "checkout")  # what a person's screens drive as
LONGEST = 48  # of a name: a common name has 64 characters (RFC 5280), ours role and serial too

LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
HOST = re.compile(rf"(?=.{{1,253}}\Z)(?!(.*\.)?\d+\Z)({LABEL}\.)*{LABEL}\Z")  # no 300.1.1.1


@dataclass(frozen=True, slots=True)
class Profile:
    """Whom a certificate is for."""

    role: Role
    name: str
    robots: tuple[str, ...] = ()  # ids; that a driver may move, or the one that it is
    addresses: tuple[str, ...] = ()  # IP addresses and host names, where it listens
    sources: tuple[str, ...] = ()  # that a driver may use; empty means any

    @property
    def who(self) -> str:
        """Return the name of its folder."""
        return f"{self.role}.{self.name}"

    @property
    def listens(self) -> bool:
        """Tell whether it is a router's."""
        return self.role in LISTENERS

    def common_name(self, serial: int) -> str:
        """Return a name that no other certificate has: access goes by it, and is taken by it."""
        return f"{self.who}.{serial:040x}"[: len(self.who) + 9]


@dataclass(frozen=True, slots=True)
class Span:
    """When a certificate is valid, in seconds since 1970."""

    begins_s: float
    ends_s: float


def profile(
    role: Role,
    name: str,
    robots: Sequence[str],
    addresses: Sequence[str],
    sources: Sequence[str] = (),
) -> Profile:
    """Return what was asked for; raise ``ConfigError`` for what such a certificate cannot be."""
    for each in (name, *(robot for robot in robots if robot != EVERY_ROBOT)):
        _check_name(each)
    for address in addresses:
        _check_address(address)
    _check_driver(role, robots, sources)
    if role not in LISTENERS and addresses:
        raise ConfigError(f"--address is for routers; a {role} dials, and nobody dials it")
    if role == "site" and not addresses:
        raise ConfigError("a site's router wants --address: where robots and laptops find it")
    if role == "robot":
        robots, addresses = (name,), addresses or VEHICLE
    found_at = unique(addresses and (*addresses, *LOCAL))
    return Profile(role, name, unique(robots), found_at, unique(sources))


def span(now_s: float, days: int, authority_ends_s: float) -> Span:
    """Return when a certificate that is made now is valid; none outlives its authority."""
    left = int((authority_ends_s - now_s) // DAY_S)
    if left < 1:
        raise RobotError(
            "the CA has reached its end and signs nothing more; `t2 keys init --folder NEW` makes "
            "another, and every certificate has to be issued anew"
        )
    if not 1 <= days <= left:
        raise ConfigError(f"--days {days}: allowed is 1..{left}, the days that the CA has left")
    return Span(now_s - EARLY_S, now_s + days * DAY_S)


def unique(texts: Iterable[str]) -> tuple[str, ...]:
    """Return each text once, in order."""
    return tuple(dict.fromkeys(texts))


def is_ip(address: str) -> bool:
    """Tell an IP address from a name."""
    try:
        ip_address(address)
    except ValueError:
        return False
    return True


def _check_name(name: str) -> None:
    try:
        msgspec.convert(name, Annotated[Name, Meta(max_length=LONGEST)])
    except msgspec.ValidationError:
        raise ConfigError(
            f"{name!r} is no name: 1 to {LONGEST} letters, digits, dots, hyphens and underscores"
        ) from None


def _check_driver(role: Role, robots: Sequence[str], sources: Sequence[str]) -> None:
    """Refuse driver options for other roles, and a driver without robots."""
    for source in sources:
        _check_source(source)
    if role == "driver" and not robots:
        raise ConfigError("a driver needs --robot ID for each robot that it may move, or --every")
    if role != "driver" and robots:
        raise ConfigError(f"--robot and --every are for drivers; a {role} has no robots to name")
    if role != "driver" and sources:
        raise ConfigError(f"--source is for drivers; a {role} does not request motion")


def _check_source(source: str) -> None:
    try:
        msgspec.convert(source, SourceName)
    except msgspec.ValidationError:
        raise ConfigError(
            f"--source {source!r} is not a source name: a small letter, then up to 31 small "
            "letters, digits, hyphens and underscores, as in safety.sources"
        ) from None


def _check_address(address: str) -> None:
    if not is_ip(address) and not HOST.match(address):
        raise ConfigError(f"--address {address!r} is no IP address and no host name")
