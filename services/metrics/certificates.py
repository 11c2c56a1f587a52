"""When whose certificate ends, from the list of members that `t2 keys` writes.

A renewed member stands on the list more than once until its old certificate has expired: the one
that ends last counts.
"""

from datetime import datetime

import msgspec
from msgspec import Struct


class Certificate(Struct, frozen=True, kw_only=True):
    """What an exporter wants to know of a member; the rest of the list is left alone."""

    role: str
    name: str
    expires: datetime  # with its zone
    revoked: bool = False


class Certificates(Struct, frozen=True, kw_only=True):
    """The list of a site."""

    members: tuple[Certificate, ...] = ()


def ends(listed: bytes) -> dict[tuple[str, str], float]:
    """Return when the certificate of each role and name ends, in seconds since 1970.

    Raise ``msgspec.DecodeError`` for what is no such list.
    """
    found: dict[tuple[str, str], float] = {}
    for one in msgspec.json.decode(listed, type=Certificates).members:
        if not one.revoked:
            who, end = (one.role, one.name), one.expires.timestamp()
            found[who] = max(end, found.get(who, end))
    return found
