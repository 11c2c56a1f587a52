"""Members of a site: the certificates that a router accepts, with their roles.

`t2 keys` writes the list, routers read it. A certificate that is not on it, or is revoked, passes
TLS and then has no permissions: Zenoh does not support revocation lists.
"""

from datetime import datetime
from pathlib import Path
from typing import Literal

import msgspec
from msgspec import Struct

from common.errors import ConfigError
from common.settings import Name, SourceName
from t2.text_file import read_text

Role = Literal["robot", "driver", "device", "viewer", "fleet", "site", "ros"]
ROLES: tuple[Role, ...] = ("robot", "driver", "device", "viewer", "fleet", "site", "ros")

OPERATORS_SOURCES = ("teleop", "web", "checkout")  # of the operator's screens


class Profile(Struct, frozen=True, kw_only=True):
    """Whom a certificate is for, and what it permits."""

    role: Role
    name: Name
    robots: tuple[str, ...] = ()  # that a driver, device or ros may use, or that a robot is
    sources: tuple[SourceName, ...] = ()  # that a driver or device may use
    addresses: tuple[str, ...] = ()  # IP addresses and host names of a router

    @property
    def label(self) -> str:
        """Return role and name, also the name of its folder."""
        return f"{self.role}.{self.name}"

    @property
    def listens(self) -> bool:
        """Return whether it is a router."""
        return self.role in ("robot", "site")


class Member(Profile, frozen=True, kw_only=True):
    """One certificate; ``common_name`` is ``ROLE.NAME.SERIAL`` and never reused."""

    common_name: str
    expires: datetime  # UTC
    revoked: bool = False


class Members(Struct, frozen=True, kw_only=True):
    """All members, revoked ones included."""

    site: Name
    members: tuple[Member, ...] = ()

    @property
    def welcome(self) -> tuple[Member, ...]:
        """Members that are not revoked."""
        return tuple(member for member in self.members if not member.revoked)


def read(file: Path) -> Members:
    """Read the list; raise ``ConfigError`` naming the file and the error."""
    try:
        return msgspec.json.decode(read_text(file), type=Members)
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}; `t2 keys` makes it") from None
    except ValueError as error:  # of the text, or of its JSON
        raise ConfigError(f"{file}: is no list of members: {error}") from None
