"""Which connections the web server admits: limits, and a reserve that E-STOP alone may use.

=========================================== ==================================================
when a connection arrives                   it becomes
=========================================== ==================================================
fewer than both limits are open             ORDINARY: may request anything
a limit is reached                          RESERVE: may request an E-STOP and nothing else
a limit is reached and the reserve is full  RESERVE, and the oldest one in the reserve is ended
=========================================== ==================================================

The one that is ended belongs to the network with the most connections in the reserve, so that one
client cannot push out another one's E-STOP. A network is an IPv4 address or the first 64 bits of an
IPv6 address, because one host has all addresses that share them.
"""

from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from ipaddress import IPv4Address, ip_address

PREFIX_BITS = 64


class Place(Enum):
    """What a connection may request."""

    ORDINARY = "ordinary"
    RESERVE = "reserve"


@dataclass
class Admission:
    """The open connections, by a number that their owner gives them."""

    total: int  # ordinary connections
    per_network: int  # ordinary connections of one network
    reserve: int
    _open: dict[int, tuple[str, Place]] = field(default_factory=dict)  # the oldest first

    def admit(self, number: int, network: str) -> tuple[Place, int | None]:
        """Take a connection in; return its place, and the number of one that has to end."""
        ordinary = self._networks(Place.ORDINARY)
        is_full = ordinary.total() >= self.total or ordinary[network] >= self.per_network
        place = Place.RESERVE if is_full else Place.ORDINARY
        self._open[number] = (network, place)
        reserved = self._networks(Place.RESERVE)
        if reserved.total() <= self.reserve:
            return place, None
        # Newcomers count, too: a network that fills the reserve pushes out its own.
        most = max(reserved.values())
        ended = next(
            number
            for number, (whose, where) in self._open.items()
            if where is Place.RESERVE and reserved[whose] == most
        )
        self.release(ended)
        return place, ended

    def release(self, number: int) -> None:
        """Forget a connection that has ended; it may be forgotten already."""
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
