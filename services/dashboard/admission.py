"""Limits of the web server: which connections it admits, and how many messages each may send.

**Connections.** A reserve serves E-STOP only:

=========================================== ====================================================
state when a connection arrives             its place
=========================================== ====================================================
below both limits                           ORDINARY: any request
a limit is reached                          RESERVE: E-STOP requests only
a limit is reached and the reserve is full  RESERVE, and the oldest one in the reserve is closed
=========================================== ====================================================

The closed connection belongs to the network with the most connections in the reserve, so that one
client cannot displace another client's E-STOP. A network is an IPv4 address or the first 64 bits of
an IPv6 address, because one host has all addresses with the same prefix.

**Messages.** Each connection has a token bucket:

========== ============================================ ==========================
verdict    state after the message has taken its token  action of the connection
========== ============================================ ==========================
ACCEPTED   tokens are left                              handle the message
DROPPED    the bucket is empty                          drop the message, count it
ABUSIVE    a whole burst was dropped                    close
========== ============================================ ==========================

A dropped message takes a token, too: a client that returns to the rate is accepted again; one that
does not is closed after two bursts.
"""

from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from ipaddress import IPv4Address, ip_address

from common.freshness import NS_PER_S

PREFIX_BITS = 64


class Place(Enum):
    """The requests that a connection may make."""

    ORDINARY = "ordinary"
    RESERVE = "reserve"


@dataclass
class Admission:
    """The open connections, by a number that their owner assigns."""

    total: int  # ordinary connections
    per_network: int  # ordinary connections of one network
    reserve: int
    _open: dict[int, tuple[str, Place]] = field(default_factory=dict)  # the oldest first

    def admit(self, number: int, network: str) -> tuple[Place, int | None]:
        """Add a connection; return its place, and the number of one that must be closed."""
        ordinary = self._networks(Place.ORDINARY)
        is_full = ordinary.total() >= self.total or ordinary[network] >= self.per_network
        place = Place.RESERVE if is_full else Place.ORDINARY
        self._open[number] = (network, place)
        reserved = self._networks(Place.RESERVE)
        if reserved.total() <= self.reserve:
            return place, None
        # The new connection counts, too: a network that fills the reserve displaces its own.
        most = max(reserved.values())
        ended = next(
            number
            for number, (owner, where) in self._open.items()
            if where is Place.RESERVE and reserved[owner] == most
        )
        self.release(ended)
        return place, ended

    def release(self, number: int) -> None:
        """Remove a connection that has ended; it may be removed already."""
        self._open.pop(number, None)

    def _networks(self, place: Place) -> Counter[str]:
        return Counter(network for network, where in self._open.values() if where is place)


def network_of(host: str) -> str:
    """Return the network that an address belongs to."""
    address = ip_address(host.partition("%")[0])
    if isinstance(address, IPv4Address):
        return str(address)
    if address.ipv4_mapped:
        return str(address.ipv4_mapped)
    return f"{address.packed[: PREFIX_BITS // 8].hex()}/{PREFIX_BITS}"


class Verdict(Enum):
    """The verdict on a message."""

    ACCEPTED = "accepted"
    DROPPED = "dropped"
    ABUSIVE = "abusive"


@dataclass
class RateLimit:
    """The token bucket of one connection."""

    rate: float  # tokens per second
    burst: float  # tokens in a full bucket
    _tokens: float = field(init=False)
    _filled_ns: int | None = None

    def __post_init__(self) -> None:
        self._tokens = self.burst

    def take(self, now_ns: int, cost: float = 1.0) -> Verdict:
        """Take the tokens of one message and return the verdict on it."""
        if self._filled_ns is not None:
            gained = self.rate * (now_ns - self._filled_ns) / NS_PER_S
            self._tokens = min(self.burst, self._tokens + gained)
        self._filled_ns = now_ns
        self._tokens = max(-self.burst, self._tokens - cost)
        if self._tokens >= 0:
            return Verdict.ACCEPTED
        return Verdict.DROPPED if self._tokens > -self.burst else Verdict.ABUSIVE
