"""The queue between Zenoh's threads and the owner's: what is kept, and when the owner is woken."""

from collections import Counter
from collections.abc import Callable

import pytest

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


@pytest.mark.parametrize("depth", [1, 3])
def test_newer_items_overwrite_the_oldest_and_wake_the_owner_once(depth: int) -> None:
    owner = Owner(depth)
    for number in range(10):
        owner.queue.put(number)
    assert len(owner.posted) == 1
    owner.turn()
    assert owner.taken == list(range(10 - depth, 10))
    assert owner.counters["overrun"] == 10 - depth
    owner.queue.put(10)
    owner.turn()
    assert owner.taken[-1] == 10


def test_an_item_that_comes_during_a_turn_is_of_the_next_turn() -> None:
    """Also the newest one is never left in the queue, and a flood does not hold the owner."""
    owner = Owner(3)
    owner.on_take = lambda item: owner.queue.put(item + 1) if item < 3 else None
    owner.queue.put(0)
    for taken in ([0], [0, 1], [0, 1, 2], [0, 1, 2, 3]):
        owner.turn()
        assert owner.taken == taken
    assert not owner.posted
