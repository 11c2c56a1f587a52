"""The items between two threads."""

import threading
from collections import deque

import pytest

from common.bus.overwriting_queue import OverwritingQueue


def test_what_came_first_goes_first() -> None:
    items: OverwritingQueue[int] = OverwritingQueue(3)
    assert [items.add(number) for number in (1, 2, 3)] == [False] * 3
    assert [items.take() for _ in range(4)] == [1, 2, 3, None]


@pytest.mark.parametrize("depth", [1, 3])
def test_a_newer_one_pushes_the_oldest_out(depth: int) -> None:
    items: OverwritingQueue[int] = OverwritingQueue(depth)
    pushed = [items.add(number) for number in range(10)]
    assert pushed == [False] * depth + [True] * (10 - depth)
    assert [items.take() for _ in range(depth)] == list(range(10 - depth, 10))


class Meddled(deque[int]):
    """Lets another thread try to take in the middle of an ``add``."""

    def __init__(self, items: OverwritingQueue[int], depth: int) -> None:
        super().__init__(maxlen=depth)
        self.taken: list[int | None] = []
        self.taker = threading.Thread(target=lambda: self.taken.append(items.take()))

    def append(self, item: int) -> None:
        if self:
            self.taker.start()
            self.taker.join(0.2)  # it cannot end in here: it has to wait
        super().append(item)


def test_what_is_taken_while_another_is_added_is_the_newest() -> None:
    """Otherwise ``add`` wakes no consumer, and the newest item stays in the queue."""
    items: OverwritingQueue[int] = OverwritingQueue(1)
    meddled = items._items = Meddled(items, 1)
    assert not items.add(1)
    assert items.add(2)
    meddled.taker.join(20)
    assert meddled.taken == [2]
    assert items.take() is None
