"""The members of a site: whose certificates a router lets in, and as what.

`t2 keys` writes the list, routers read it. A certificate that is not on it, or that is revoked,
passes TLS and then may do nothing: Zenoh knows no revocation lists.
"""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from common.errors import ConfigError

Role = Literal["robot", "driver", "viewer", "fleet", "site"]
ROLES: tuple[Role, ...] = ("robot", "driver", "viewer", "fleet", "site")

# The name of a source of motion requests, as in ``safety.sources``.
SourceName = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_-]{0,31}\Z")]
# A robot's id, and whatever else becomes a part of a certificate's name: one chunk of a key.
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9_.-]{1,60}\Z")]


class Member(Struct, frozen=True, kw_only=True):
    """One certificate; ``common_name`` is ``ROLE.NAME.SERIAL`` and never used again."""

    common_name: str
    role: Role
    name: Name
    robots: tuple[str, ...] = ()  # that a driver may move, or that a robot is
    sources: tuple[SourceName, ...] = ()  # that a driver may use; empty means any
    addresses: tuple[str, ...] = ()  # where a router is dialled; lists of before have none
    expires: datetime  # UTC
    revoked: bool = False


class Members(Struct, frozen=True, kw_only=True):
    """Everybody who has ever been a member."""

    site: Name
    members: tuple[Member, ...] = ()

    @property
    def welcome(self) -> tuple[Member, ...]:
        """Those who are let in."""
        return tuple(member for member in self.members if not member.revoked)


def read(file: Path) -> Members:
    """Return the list; raise ``ConfigError`` naming the file and what is wrong with it."""
    try:
        return msgspec.json.decode(file.read_bytes(), type=Members)
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}; `t2 keys` makes it") from None
    except msgspec.DecodeError as error:  # a ValidationError is one, too
        raise ConfigError(f"{file}: is no list of members: {error}") from None
