"""A bus without a bus: one thread, simulated time, and weather of its own on each route.

Messages are handed over as they are: what MessagePack and Zenoh do to them is tested elsewhere.
"""

import heapq
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol

from common.freshness import NS_PER_S
from common.messages import Message

MS = NS_PER_S // 1000
ECHO_MS, HOLD_MS = 30, 45  # later than the first copy; later than its neighbours


@dataclass(frozen=True, slots=True)
class Weather:
    """What happens to the messages of a route; counts are "every so many-th", 0 for none."""

    late_ms: int = 0
    lose: int = 0
    double: int = 0
    hold: int = 0  # so late that others overtake it

    def delays_ms(self, count: int) -> list[int]:
        """Return when the copies of the ``count``-th message arrive; none when it is lost."""
        if self.lose and count % self.lose == 0:
            return []
        held = HOLD_MS if self.hold and count % self.hold == 0 else 0
        first = self.late_ms + held
        return [first, first + ECHO_MS] if self.double and count % self.double == 0 else [first]


CLEAR = Weather()


class Owner(Protocol):
    """A process at one end."""

    boot: int
    alive: bool

    @property
    def hangs(self) -> bool:
        """Whether it does nothing for now."""


@dataclass(frozen=True, slots=True)
class Letter:
    """One message under way."""

    key: str
    message: Message
    sender: int  # ``boot`` of the process that sent it
    sent_ns: int
    private: bool = False  # it travels on the drive link, too


@dataclass(slots=True)
class Ear:
    """One subscription; what came while its owner hung waits, the newest only."""

    owner: Owner
    key: str
    take: Callable[[Letter], None]
    depth: int
    private: bool = False  # it takes what comes by the drive link, and nothing else
    waiting: deque[Letter] = field(default_factory=deque)

    def hears(self, key: str) -> bool:
        """Tell whether a key is meant."""
        return matches(self.key, key)

    def hand_over(self, letter: Letter) -> None:
        """Give it to the owner, now or when it hangs no more."""
        if not self.owner.alive:
            return
        self.waiting.append(letter)
        while len(self.waiting) > self.depth:
            self.waiting.popleft()
        self.drain()

    def drain(self) -> None:
        """Let the owner take what waits, unless it hangs."""
        while self.waiting and not self.owner.hangs:
            self.take(self.waiting.popleft())


@cache
def matches(expression: str, key: str) -> bool:
    """Tell whether a key is one of an expression's; ``*`` stands for one chunk."""
    mine, others = expression.split("/"), key.split("/")
    pairs = zip(mine, others, strict=False)
    return len(mine) == len(others) and all(one in ("*", other) for one, other in pairs)


def route(key: str) -> str:
    """Name the route of a key, for its weather."""
    for name in ("drive", "motion", "state"):
        if f"/{name}" in key:
            return name
    return "streams"


class Net:
    """Carries letters to ears; while it is down nothing arrives but by the drive link."""

    def __init__(self, now_ns: int) -> None:
        self.now_ns = now_ns
        self.up = True
        self.weather: dict[str, Weather] = {}
        self.ears: list[Ear] = []
        self._under_way: list[tuple[int, int, Ear | None, Callable[[], None]]] = []
        self._counts: Counter[tuple[str, str]] = Counter()
        self._order = 0

    def put(self, letter: Letter) -> None:
        """Send one to all who listen."""
        for ear in self.ears:
            reached = letter.private if ear.private else self.up
            if reached and ear.owner.alive and ear.hears(letter.key):
                self.later(route(letter.key), lambda ear=ear: ear.hand_over(letter), ear)  # type: ignore[misc]

    def later(
        self, name: str, arrive: Callable[[], None], ear: Ear | None = None, kind: str = ""
    ) -> None:
        """Let something arrive by the weather of a route; each kind is counted on its own."""
        self._counts[name, kind] += 1
        for delay_ms in self.weather.get(name, CLEAR).delays_ms(self._counts[name, kind]):
            self._order += 1
            entry = (self.now_ns + delay_ms * MS, self._order, ear, arrive)
            heapq.heappush(self._under_way, entry)

    def turn(self) -> None:
        """Hand over what has arrived by now."""
        while self._under_way and self._under_way[0][0] <= self.now_ns:
            _, _, ear, arrive = heapq.heappop(self._under_way)
            if self.up or ear is None or ear.private:
                arrive()

    def wake(self, owner: Owner) -> None:
        """Hand over what waited for a process that hangs no more."""
        for ear in self.ears:
            if ear.owner is owner:
                ear.drain()


class Caller:
    """Takes the answer to a call."""

    def __init__(self) -> None:
        self.done: bool | None = None
        self.text = ""

    def reply(self, message: Any) -> None:
        """Take a reply."""
        self.done = True

    def refuse(self, reason: str) -> None:
        """Take a refusal."""
        self.done, self.text = False, reason
