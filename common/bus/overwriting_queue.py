"""Bounded queue between Zenoh's threads and a handler; it overwrites the oldest item."""

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class OverwritingQueue(Generic[T]):
    """Queue of up to ``depth`` items.

    Check and append are one step, under a lock: the producer wakes the consumer only for an item
    that overwrote none, so an item lost between both steps would stall the queue.
    """

    def __init__(self, depth: int) -> None:
        self._items: deque[T] = deque(maxlen=depth)
        self._lock = threading.Lock()

    def add(self, item: T) -> bool:
        """Append an item; return whether the oldest one was dropped."""
        with self._lock:
            full = len(self._items) == self._items.maxlen
            self._items.append(item)
        return full

    def take(self) -> T | None:
        """Remove and return the oldest item, or None."""
        with self._lock:
            return self._items.popleft() if self._items else None
