"""The member list: valid profiles, lookup, revocation, and the table of ``t2 keys list``. Pure.

Routers of robots and sites listen: their certificates hold addresses and are valid for both ends of
a link. All other members only connect, and their certificates are not valid for a router.
"""

import re
from collections.abc import Mapping, Sequence
from ipaddress import ip_address
from typing import Annotated, Literal

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from cli.inspect import output
from cli.keys.members import OPERATORS_SOURCES, Member, Members, Profile, Role
from common.errors import ConfigError
from common.settings import Name, SourceName
from t2.errors import T2Error

DAY_S = 86_400
CA_DAYS = 3650
DAYS = 365
EARLY_S = DAY_S  # valid from a day ago: clocks differ, and a wrong time zone is up to 14 h
SOON_DAYS = 30

BOUND: tuple[Role, ...] = ("driver", "device", "ros")  # to robots
SOURCED: tuple[Role, ...] = ("driver", "device")  # to sources
LOCAL = ("localhost", "127.0.0.1")  # for clients on the same host, or through a tunnel
VEHICLE = ("192.168.201.1", "10.7.5.220")  # on its own Wi-Fi and on its cable (manual 1 and 1.1)
EVERY_ROBOT = "*"
LONGEST = 48  # of a name: a common name has 64 characters (RFC 5280), ours role and serial too
NAMES = f"1 to {LONGEST} letters, digits, dots, hyphens and underscores"
SOURCE_NAMES = "a lowercase letter, then up to 31 of a-z, 0-9, hyphen and underscore"
LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
HOST = re.compile(rf"(?=.{{1,253}}\Z)(?!(.*\.)?\d+\Z)({LABEL}\.)*{LABEL}\Z")  # no 300.1.1.1
HEAD = ("certificate", "robots", "sources", "until", "state")

Span = tuple[float, float]  # validity of a certificate, in seconds since 1970
State = Literal["valid", "expires soon", "expired", "revoked"]


def profile(
    role: Role,
    name: str,
    robots: Sequence[str] = (),
    addresses: Sequence[str] = (),
    sources: Sequence[str] = (),
) -> Profile:
    """Return the profile for the given options; raise ``ConfigError`` if they are invalid."""
    for each in (name, *(robot for robot in robots if robot != EVERY_ROBOT)):
        _check(each, Annotated[Name, Meta(max_length=LONGEST)], f"{each!r} is not a name: {NAMES}")
    for source in sources:
        _check(source, SourceName, f"--source {source!r} is not a source name: {SOURCE_NAMES}")
    _check_rights(role, robots, sources)
    addresses = _addresses(role, addresses)
    return Profile(
        role=role,
        name=name,
        robots=(name,) if role == "robot" else tuple(dict.fromkeys(robots)),
        addresses=tuple(dict.fromkeys(addresses)),
        sources=tuple(dict.fromkeys(sources)),
    )


def default_sources(role: Role, name: str) -> tuple[str, ...]:
    """Return the sources of a member for which none are given."""
    return {"driver": OPERATORS_SOURCES, "device": (name,)}.get(role, ())


def span(now_s: float, days: int, authority_ends_s: float) -> Span:
    """Return the validity of a new certificate; it never exceeds the authority's."""
    left = int((authority_ends_s - now_s) // DAY_S)
    if left < 1:
        raise T2Error(
            "the CA has expired; `t2 keys init --folder NEW` creates another, and every "
            "certificate must be issued again"
        )
    if not 1 <= days <= left:
        raise ConfigError(f"--days {days}: allowed is 1..{left}, the remaining validity of the CA")
    return now_s - EARLY_S, now_s + days * DAY_S


def common_name(profile: Profile, serial: int) -> str:
    """Return a unique name: access is granted and revoked by it."""
    return f"{profile.label}.{serial:040x}"[: len(profile.label) + 9]


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


def _check_rights(role: Role, robots: Sequence[str], sources: Sequence[str]) -> None:
    """Reject robots and sources for other roles, and a member without robots that needs one."""
    if role in BOUND and not robots:
        raise ConfigError(f"a {role} needs --robot ID for each of its robots, or --robot '*'")
    if role not in BOUND and robots:
        raise ConfigError(f"--robot is for drivers, devices and ros, not for a {role}")
    if role not in SOURCED and sources:
        raise ConfigError(f"--source is for drivers and devices; a {role} uses no source")


def _addresses(role: Role, given: Sequence[str]) -> Sequence[str]:
    """Return the addresses of a certificate; localhost is always one of a router."""
    for address in given:
        if not is_ip(address) and not HOST.match(address):
            raise ConfigError(f"--address {address!r} is neither an IP address nor a host name")
    if role == "robot":
        given = given or VEHICLE
    elif role == "site" and not given:
        raise ConfigError("a site's router needs --address: robots and laptops connect to it")
    elif role != "site" and given:
        raise ConfigError(f"--address is for routers; a {role} only connects")
    return (*given, *LOCAL) if given else ()


def newest(members: Members, role: Role, name: str) -> Member:
    """Return the latest certificate of a member; raise ``T2Error`` without one."""
    found = _newest(members).get((role, name))
    if found is None:
        raise T2Error(
            f"{role} {name} has no certificate, or a revoked one; "
            f"`t2 keys issue {role} {name}` makes one"
        )
    return found


def routers(members: Members) -> list[Member]:
    """Return the latest certificate of each admitted router."""
    return [each for _, each in sorted(_newest(members).items()) if each.listens]


def check_free(members: Members, role: Role, name: str, now_s: float) -> None:
    """Raise ``T2Error`` if a member of that name has a valid certificate."""
    for each in reversed(members.welcome):
        if (each.role, each.name) == (role, name) and each.expires.timestamp() > now_s:
            raise T2Error(
                f"{role} {name} has a certificate until {each.expires:%Y-%m-%d}; "
                f"`t2 keys renew {role} {name}` makes another, `revoke` revokes it"
            )


def revoked(
    members: Members, role: Role, name: str, serial: str | None
) -> tuple[Members, Sequence[Member]]:
    """Return the list with revoked certificates of a member, and the revoked ones."""
    # An empty serial, as of an unset variable of a shell, must not revoke all.
    ends = "" if serial is None else f".{serial}"
    matching = [
        each
        for each in members.welcome
        if (each.role, each.name) == (role, name) and each.common_name.endswith(ends)
    ]
    if not matching:
        with_serial = "" if serial is None else f" with the serial {serial!r}"
        raise T2Error(f"{role} {name} has no certificate{with_serial} that could be revoked")
    left = tuple(
        replace(each, revoked=True) if each in matching else each for each in members.members
    )
    return replace(members, members=left), matching


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
            member.common_name,
            " ".join(member.robots) or "-",
            " ".join(member.sources) or "-",
            f"{member.expires:%Y-%m-%d}",
            state(member, now_s),
        )
        for member in members.members
    ]
    return output.table(HEAD, rows)


def _newest(members: Members) -> Mapping[tuple[Role, str], Member]:
    """Return the latest certificate of each admitted member, by role and name."""
    return {(member.role, member.name): member for member in members.welcome}
