"""When whose certificate ends, from the list of members that `t2 keys` writes. Pure.

A renewed member stands on the list more than once until its old certificate has expired: the one
that ends last counts.
"""

from common.members import Members


def ends(listed: Members) -> dict[tuple[str, str], float]:
    """Return when the certificate of each role and name ends, in seconds since 1970."""
    found: dict[tuple[str, str], float] = {}
    for one in listed.welcome:
        who, end = (one.role, one.name), one.expires.timestamp()
        found[who] = max(end, found.get(who, end))
    return found
