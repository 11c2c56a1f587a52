"""The ring between two threads."""

import threading
from collections import deque

import pytest

from common.bus.overwriting_queue import Ring


def test_what_came_first_goes_first() -> None:
    ring: Ring[int] = Ring(3)
    assert [ring.add(number) for number in (1, 2, 3)] == [False] * 3
    assert [ring.take() for _ in range(4)] == [1, 2, 3, None]


@pytest.mark.parametrize("depth", [1, 3])
def test_a_newer_one_pushes_the_oldest_out(depth: int) -> None:
    ring: Ring[int] = Ring(depth)
    pushed = [ring.add(number) for number in range(10)]
    assert pushed == [False] * depth + [True] * (10 - depth)
    assert [ring.take() for _ in range(depth)] == list(range(10 - depth, 10))


class Meddled(deque[int]):
    """Lets another thread try to take in the middle of an ``add``."""

    def __init__(self, ring: Ring[int], depth: int) -> None:
        super().__init__(maxlen=depth)
        self.taken: list[int | None] = []
        self.taker = threading.Thread(target=lambda: self.taken.append(ring.take()))

    def append(self, item: int) -> None:
        if self:
            self.taker.start()
            self.taker.join(0.2)  # it cannot end in here: it has to wait
        super().append(item)


def test_what_is_taken_while_another_is_added_is_the_newest() -> None:
    """Else ``add`` says that an older one went, nobody is woken, and the newest stays for good."""
    ring: Ring[int] = Ring(1)
    meddled = ring._items = Meddled(ring, 1)
    assert not ring.add(1)
    assert ring.add(2)
    meddled.taker.join(20)
    assert meddled.taken == [2]
    assert ring.take() is None
