"""What waits between a thread of Zenoh's and the owner's: the newest few, the oldest goes first."""

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Ring(Generic[T]):
    """Holds up to ``depth`` items.

    Looking and adding are one step, under a lock: the adder wakes the taker only for an item that
    pushed no other out, so an item that is lost between the two would silence the ring for good.
    """

    def __init__(self, depth: int) -> None:
        self._items: deque[T] = deque(maxlen=depth)
        self._lock = threading.Lock()

    def add(self, item: T) -> bool:
        """Add the newest; tell whether the oldest had to go for it."""
        with self._lock:
            full = len(self._items) == self._items.maxlen
            self._items.append(item)
        return full

    def take(self) -> T | None:
        """Take the oldest, or None."""
        with self._lock:
            return self._items.popleft() if self._items else None
