"""Limits of wrong tokens, per address and in all; pure.

An address has ``BURST`` wrong guesses, and one more each ``PERIOD_S``; without any left its tokens
are not compared. All addresses together have ``ALL_BURST`` and ``ALL_PERIOD_S``. The same wrong
token again costs nothing.

A guesser must not keep an operator out: an address that was right before has its own limit only,
and whoever is logged in needs no token.
"""

from collections import OrderedDict, deque
from dataclasses import dataclass, field
from ipaddress import IPv6Address, ip_address

from common.freshness import NS_PER_S

BURST, PERIOD_S = 5, 1.0
ALL_BURST, ALL_PERIOD_S = 20, 0.2
ADDRESSES_MAX = 4096  # the one that was not used for the longest time is forgotten
WRONG_MAX = 8  # wrong guesses of an address that are remembered
PREFIX = 64  # bits: one host has a whole IPv6 network


@dataclass
class Budget:
    """Wrong guesses that are left: a number at once, and one more in each period."""

    burst: int
    period_s: float
    _until_ns: int = 0  # when all are there again

    def wait_s(self, now_ns: int) -> float:
        """Return the time until a guess is allowed; 0 if it is allowed now."""
        period_ns = round(self.period_s * NS_PER_S)
        return max(0, self._until_ns - now_ns - (self.burst - 1) * period_ns) / NS_PER_S

    def spend(self, now_ns: int) -> None:
        """Count a wrong guess."""
        self._until_ns = max(self._until_ns, now_ns) + round(self.period_s * NS_PER_S)


@dataclass
class Address:
    """What an address has guessed."""

    budget: Budget = field(default_factory=lambda: Budget(BURST, PERIOD_S))
    wrong: deque[str] = field(default_factory=lambda: deque(maxlen=WRONG_MAX))
    was_right: bool = False


class GuessLimit:
    """The wrong guesses of all addresses."""

    def __init__(self) -> None:
        self._addresses: OrderedDict[str, Address] = OrderedDict()
        self._all = Budget(ALL_BURST, ALL_PERIOD_S)

    def wait_s(self, host: str, guess: str, now_ns: int) -> float:
        """Return the time until this token may be compared; 0 if it may be now."""
        address = self._address(host)
        if guess in address.wrong:
            return 0.0  # it tells nothing new
        own_s = address.budget.wait_s(now_ns)
        return own_s if address.was_right else max(own_s, self._all.wait_s(now_ns))

    def compared(self, host: str, guess: str, now_ns: int, *, is_right: bool) -> None:
        """Note the result of a comparison."""
        address = self._address(host)
        if is_right:
            address.was_right = True
        elif guess not in address.wrong:
            address.wrong.append(guess)
            address.budget.spend(now_ns)
            self._all.spend(now_ns)

    def _address(self, host: str) -> Address:
        name = network(host)
        address = self._addresses.setdefault(name, Address())
        self._addresses.move_to_end(name)
        if len(self._addresses) > ADDRESSES_MAX:
            self._addresses.popitem(last=False)
        return address


def network(host: str) -> str:
    """Return the address of a client, or the network that belongs to one client."""
    try:
        address = ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if not isinstance(address, IPv6Address):
        return host
    if address.ipv4_mapped:
        return str(address.ipv4_mapped)
    return str(int(address) >> (128 - PREFIX))
