"""A service's one thread: sockets, timers, and what other threads hand over.

Everything that a service decides happens in here, one thing at a time, so that its cores need no
locks. Zenoh's threads only ``post``.
"""

import contextlib
import selectors
import socket
import time
from collections import deque
from collections.abc import Callable

from msgspec import Struct

from common.freshness import NS_PER_S

Handler = Callable[[int], object]  # takes the monotonic time in nanoseconds


class Timer(Struct):
    """A call that is due every period; a late one is made once, never caught up in a burst."""

    period_ns: int
    due_ns: int
    handler: Handler
    late_ns: int = 0  # at worst

    def call(self, now_ns: int) -> None:
        """Make the call if it is due."""
        late_ns = now_ns - self.due_ns
        if late_ns < 0:
            return
        self.late_ns = max(self.late_ns, late_ns)
        self.due_ns += self.period_ns * (late_ns // self.period_ns + 1)
        self.handler(now_ns)

    def put_off(self, now_ns: int) -> None:
        """Make the next call a period from now, as what it is for has just been done."""
        self.late_ns = max(self.late_ns, now_ns - self.due_ns)
        self.due_ns = now_ns + self.period_ns


class Loop:
    """Waits for what is due next and does it, until ``stop``."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._timers: list[Timer] = []
        self._posted: deque[Callable[[], object]] = deque()
        self._wake_in, self._wake_out = socket.socketpair()
        self._wake_in.setblocking(False)
        self._wake_out.setblocking(False)
        self._selector.register(self._wake_out, selectors.EVENT_READ, self._drain)
        self._stopped = False

    def watch(self, sock: socket.socket, handler: Handler) -> None:
        """Call the handler whenever the socket can be read."""
        self._selector.register(sock, selectors.EVENT_READ, handler)

    def every(self, period_s: float, handler: Handler) -> Timer:
        """Call the handler every ``period_s`` seconds, the first time at once.

        Like ``watch`` it is for the loop's own thread; another thread posts it.
        """
        timer = Timer(round(period_s * NS_PER_S), time.monotonic_ns(), handler)
        self._timers.append(timer)
        return timer

    def post(self, call: Callable[[], object]) -> None:
        """Hand a call over from any thread; it is made in the loop's own."""
        self._posted.append(call)
        # A full pipe already holds a wake-up; a closed one has nobody left to wake.
        with contextlib.suppress(OSError):
            self._wake_in.send(b"\0")

    def stop(self) -> None:
        """Let ``run`` return after the current call; safe in a signal handler."""
        self._stopped = True
        self.post(lambda: None)

    def run(self) -> None:
        """Serve until ``stop``, which may have been said before; may be run again after that."""
        while not self._stopped:
            for key, _ in self._selector.select(self._until_due_s()):
                key.data(time.monotonic_ns())
            # Handed over before the timers look: they judge how old things are.
            self._make_posted()
            self._call_due()
        self._stopped = False

    def close(self) -> None:
        """Give the descriptors back."""
        self._selector.close()
        self._wake_in.close()
        self._wake_out.close()

    def take_lateness_s(self) -> float:
        """Return how late the latest timer was since the last call, in seconds."""
        late_ns = max((timer.late_ns for timer in self._timers), default=0)
        for timer in self._timers:
            timer.late_ns = 0
        return late_ns / NS_PER_S

    def _until_due_s(self) -> float | None:
        if not self._timers:
            return None
        due = min(timer.due_ns for timer in self._timers)
        return max(0, due - time.monotonic_ns()) / NS_PER_S

    def _call_due(self) -> None:
        for timer in self._timers:
            timer.call(time.monotonic_ns())

    def _drain(self, _: int) -> None:
        with contextlib.suppress(BlockingIOError):
            self._wake_out.recv(65_536)  # what is left wakes once more
        self._make_posted()

    def _make_posted(self) -> None:
        for _ in range(len(self._posted)):
            self._posted.popleft()()
