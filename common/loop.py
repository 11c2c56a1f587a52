"""Event loop of a service: one thread for sockets, timers, and calls from other threads.

All decisions of a service run here, one at a time, so that its cores need no locks. Zenoh's threads
only ``post``.
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
    """A periodic call; a late one is made once, without catching up in a burst."""

    period_ns: int
    due_ns: int
    handler: Handler
    late_ns: int = 0  # maximum since the last report

    def call(self, now_ns: int) -> None:
        """Call the handler if it is due."""
        late_ns = now_ns - self.due_ns
        if late_ns < 0:
            return
        self.late_ns = max(self.late_ns, late_ns)
        self.due_ns += self.period_ns * (late_ns // self.period_ns + 1)
        self.handler(now_ns)

    def defer(self, now_ns: int) -> None:
        """Defer the next call to a period from now: its work was just done."""
        self.late_ns = max(self.late_ns, now_ns - self.due_ns)
        self.due_ns = now_ns + self.period_ns


class Loop:
    """Runs handlers as they become due, until ``stop``."""

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
        """Call the handler whenever the socket is readable."""
        self._selector.register(sock, selectors.EVENT_READ, handler)

    def every(self, period_s: float, handler: Handler) -> Timer:
        """Call the handler every ``period_s`` seconds, the first time at once.

        Like ``watch``, call it in the loop's own thread; other threads use ``post``.
        """
        timer = Timer(round(period_s * NS_PER_S), time.monotonic_ns(), handler)
        self._timers.append(timer)
        return timer

    def post(self, call: Callable[[], object]) -> None:
        """Queue a call from any thread; the loop's thread makes it."""
        self._posted.append(call)
        # A full socket already holds a wake-up; a closed one needs none.
        with contextlib.suppress(OSError):
            self._wake_in.send(b"\0")

    def stop(self) -> None:
        """Make ``run`` return after the current call; safe in a signal handler."""
        self._stopped = True
        self.post(lambda: None)

    def run(self) -> None:
        """Run until ``stop``, which may precede this call; may be run again after that."""
        while not self._stopped:
            for key, _ in self._selector.select(self._until_due_s()):
                key.data(time.monotonic_ns())
            # Posted calls first: timers check the age of data.
            self._make_posted()
            self._call_due()
        self._stopped = False

    def close(self) -> None:
        """Close the descriptors."""
        self._selector.close()
        self._wake_in.close()
        self._wake_out.close()

    def take_lateness_s(self) -> float:
        """Return the maximum timer lateness since the last call, in seconds."""
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
            self._wake_out.recv(65_536)  # the rest wakes the loop again
        self._make_posted()

    def _make_posted(self) -> None:
        for _ in range(len(self._posted)):
            self._posted.popleft()()
