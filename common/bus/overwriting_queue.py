"""Bounded queue from Zenoh's threads to a handler in the owner's thread; drops the oldest item."""

from collections import Counter, deque
from collections.abc import Callable
from typing import Generic, TypeVar

from common.loop import Post

T = TypeVar("T")


class OverwritingQueue(Generic[T]):
    """Queue of up to ``depth`` items for ``take``; overwritten ones count as ``overrun``."""

    def __init__(
        self, depth: int, take: Callable[[T], None], post: Post, counters: Counter[str]
    ) -> None:
        self._items: deque[T] = deque(maxlen=depth)
        self._take = take
        self._post = post
        self._counters = counters
        self._posted = False

    def put(self, item: T) -> None:
        """Append an item, on a thread of Zenoh; never waits."""
        if len(self._items) == self._items.maxlen:
            self._counters["overrun"] += 1
        self._items.append(item)
        if not self._posted:
            self._posted = True
            self._post(self._drain)

    def _drain(self) -> None:
        self._posted = False  # first: an item that comes now posts again
        for _ in range(len(self._items)):  # in a flood, timers and sockets have their turn, too
            self._take(self._items.popleft())
