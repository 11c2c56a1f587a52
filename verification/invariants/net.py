"""Simulated bus: one thread, simulated time, and a disturbance per route.

Messages are delivered as Python objects: MessagePack and Zenoh are tested elsewhere.
"""

import heapq
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, Protocol

from common.freshness import NS_PER_S
from common.messages import Message

MS = NS_PER_S // 1000
ECHO_MS, HOLD_MS = 30, 45  # later than the first copy; later than its neighbours


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Disturbance of a route: delay, loss, duplicates; counts mean every n-th message, 0 none."""

    late_ms: int = 0
    lose: int = 0
    double: int = 0
    hold: int = 0  # delayed so that later ones overtake it

    def delays_ms(self, count: int) -> list[int]:
        """Return the delays of the copies of the ``count``-th message; none when it is lost."""
        if self.lose and count % self.lose == 0:
            return []
        held = HOLD_MS if self.hold and count % self.hold == 0 else 0
        first = self.late_ms + held
        return [first, first + ECHO_MS] if self.double and count % self.double == 0 else [first]


CLEAR = Disturbance()


class Owner(Protocol):
    """The subscribing process."""

    boot: int
    alive: bool
    cut: bool

    @property
    def stalled(self) -> bool:
        """Whether the process is stalled."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """One message in transit."""

    key: str
    message: Message
    sender: int  # ``boot`` of the process that sent it
    sent_ns: int
    private: bool = False  # also sent on the drive link


@dataclass(slots=True)
class Subscription:
    """One subscription; during a stall of its owner it queues the newest messages."""

    owner: Owner
    key: str
    take: Callable[[Envelope], None]
    depth: int
    private: bool = False  # receives from the drive link only
    waiting: deque[Envelope] = field(default_factory=deque)

    def matches(self, key: str) -> bool:
        """Return whether a key matches."""
        return matches(self.key, key)

    def hand_over(self, envelope: Envelope) -> None:
        """Deliver to the owner, now or after its stall."""
        lost = self.owner.stalled and self.owner.cut and not self.private
        if lost or not self.owner.alive:
            return
        self.waiting.append(envelope)
        while len(self.waiting) > self.depth:
            self.waiting.popleft()
        self.drain()

    def drain(self) -> None:
        """Deliver the queued messages, unless the owner is stalled."""
        while self.waiting and not self.owner.stalled:
            self.take(self.waiting.popleft())


@cache
def matches(expression: str, key: str) -> bool:
    """Return whether a key expression matches a key; ``*`` is one chunk."""
    mine, others = expression.split("/"), key.split("/")
    pairs = zip(mine, others, strict=False)
    return len(mine) == len(others) and all(one in ("*", other) for one, other in pairs)


def route(key: str) -> str:
    """Return the route of a key, for its disturbance."""
    for name in ("drive", "limit", "estop_keepalive", "motion", "state"):
        if f"/{name}" in key:
            return name
    return "streams"


class Net:
    """Delivers envelopes to subscriptions; while it is down only the drive link delivers."""

    def __init__(self, now_ns: int) -> None:
        self.now_ns = now_ns
        self.up = True
        self.connections = 1  # since the start
        self.disturbances: dict[str, Disturbance] = {}
        self.subscriptions: list[Subscription] = []
        self._under_way: list[tuple[int, int, Subscription | None, Callable[[], None]]] = []
        self._counts: Counter[tuple[str, str]] = Counter()
        self._order = 0

    @property
    def connection(self) -> int:
        """Number of the connection to the router; 0 without one."""
        return self.connections if self.up else 0

    def put(self, envelope: Envelope) -> None:
        """Send an envelope to all matching subscriptions."""
        for subscription in self.subscriptions:
            reached = envelope.private if subscription.private else self.up
            if reached and subscription.owner.alive and subscription.matches(envelope.key):
                deliver = partial(subscription.hand_over, envelope)
                self.later(route(envelope.key), deliver, subscription)

    def later(
        self,
        name: str,
        arrive: Callable[[], None],
        subscription: Subscription | None = None,
        kind: str = "",
    ) -> None:
        """Deliver something under the disturbance of a route; each kind is counted separately."""
        self._counts[name, kind] += 1
        for delay_ms in self.disturbances.get(name, CLEAR).delays_ms(self._counts[name, kind]):
            self._order += 1
            entry = (self.now_ns + delay_ms * MS, self._order, subscription, arrive)
            heapq.heappush(self._under_way, entry)

    def turn(self) -> None:
        """Deliver everything that is due."""
        while self._under_way and self._under_way[0][0] <= self.now_ns:
            _, _, subscription, arrive = heapq.heappop(self._under_way)
            if self.up or subscription is None or subscription.private:
                arrive()

    def wake(self, owner: Owner) -> None:
        """Deliver what queued up during the stall of a process."""
        for subscription in self.subscriptions:
            if subscription.owner is owner:
                subscription.drain()


class Caller:
    """Stores the answer to a call."""

    def __init__(self) -> None:
        self.done: bool | None = None
        self.text = ""

    def reply(self, message: Any) -> None:
        """Store a reply."""
        self.done = True

    def refuse(self, reason: str) -> None:
        """Store a refusal."""
        self.done, self.text = False, reason
