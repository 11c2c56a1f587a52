"""The queue between Zenoh's threads and the owner's: what is kept, and when the owner is woken."""

from collections import Counter
from collections.abc import Callable

from common.bus.bus import OverwritingQueue


class Owner:
    """An owner that makes the posted calls when the test says so."""

    def __init__(self, depth: int) -> None:
        self.posted: list[Callable[[], None]] = []
        self.taken: list[int] = []
        self.counters: Counter[str] = Counter()
        self.on_take: Callable[[int], None] = lambda _: None
        self.queue = OverwritingQueue(depth, self.take, self.posted.append, self.counters)

    def take(self, item: int) -> None:
        self.taken.append(item)
        self.on_take(item)

    def turn(self) -> None:
        calls, self.posted[:] = self.posted[:], []
        for call in calls:
            call()


def test_an_item_that_comes_during_a_turn_is_of_the_next_turn() -> None:
    """Also the newest one is never left in the queue, and a flood does not hold the owner."""
    owner = Owner(3)
    owner.on_take = lambda item: owner.queue.put(item + 1) if item < 3 else None
    owner.queue.put(0)
    for taken in ([0], [0, 1], [0, 1, 2], [0, 1, 2, 3]):
        owner.turn()
        assert owner.taken == taken
    assert not owner.posted
