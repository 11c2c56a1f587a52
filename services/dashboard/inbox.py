"""Messages of viewers on their way to the fleet's thread: bounded, and emergency stops first."""

from collections import deque
from collections.abc import Callable

WAITING_MAX = 32  # messages of one viewer

Call = Callable[[], None]
Post = Callable[[Call], None]


class Queue:
    """What one viewer's messages wait in."""

    def __init__(self) -> None:
        self.calls: deque[Call] = deque()

    @property
    def is_full(self) -> bool:
        """Whether the fleet is so far behind that a message must be dropped."""
        return len(self.calls) >= WAITING_MAX


class Inbox:
    """Posts calls; an emergency stop is made before any call of a viewer that still waits."""

    def __init__(self, post: Post) -> None:
        self._post = post
        self._stops: dict[str, Call] = {}

    def stop(self, robot: str, call: Call) -> None:
        """Make this call ahead of others; one that waits for the same robot is replaced."""
        self._stops[robot] = call
        self._post(self._take_stops)

    def put(self, queue: Queue, call: Call) -> None:
        """Make this call after those that wait in the same queue."""
        queue.calls.append(call)
        self._post(lambda: self._take(queue))

    def _take(self, queue: Queue) -> None:
        self._take_stops()
        queue.calls.popleft()()

    def _take_stops(self) -> None:
        while self._stops:
            _, call = self._stops.popitem()
            call()
