"""Event loop of a service: its sockets, its timers, and the calls that other threads post.

All of them run in the one thread that calls ``run``, so that the cores need no locks:
``docs/decisions.md#one-thread-decides``.
"""

import contextlib
import selectors
import socket
from collections import deque
from collections.abc import Callable

from msgspec import Struct

from common import clock
from common.freshness import NS_PER_S

Handler = Callable[[int], object]  # takes the monotonic time in nanoseconds
Call = Callable[[], object]
Post = Callable[[Callable[[], None]], None]  # passes a call to the owner's thread, as ``Loop.post``


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


class Loop:
    """Runs handlers as they become due, until ``stop``."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._timers: list[Timer] = []
        self._posted: deque[Call] = deque()
        self._sleeps = False  # or is about to: whoever posts then must wake it
        self._stopped = False
        self._wake_in, self._wake_out = socket.socketpair()
        self._wake_in.setblocking(False)
        self._wake_out.setblocking(False)
        self.watch(self._wake_out, self._drain)

    def watch(self, sock: socket.socket, handler: Handler) -> None:
        """Call the handler whenever the socket is readable."""
        self._selector.register(sock, selectors.EVENT_READ, handler)

    def every(self, period_s: float, handler: Handler) -> Timer:
        """Call the handler every ``period_s`` seconds, the first time at once.

        Like ``watch``, call it before ``run`` or in a handler; other threads use ``post``.
        """
        timer = Timer(round(period_s * NS_PER_S), clock.now_ns(), handler)
        self._timers.append(timer)
        return timer

    def post(self, call: Call) -> None:
        """Queue a call from any thread; never waits."""
        self._posted.append(call)
        if self._sleeps:
            self._sleeps = False  # one wake-up is enough for all calls until it sleeps again
            self._wake()

    def defer(self, call: Call) -> None:
        """Queue a call from any thread for when the loop wakes up next; never waits."""
        self._posted.append(call)

    def stop(self) -> None:
        """Make ``run`` return after the current call; safe in a signal handler."""
        self._stopped = True
        self._wake()

    def run(self) -> None:
        """Run until ``stop``, which may precede this call; may be run again after that."""
        while not self._stopped:
            for key, _ in self._select():
                key.data(clock.now_ns())
            # Calls of other threads first: timers check the age of data.
            for _ in range(len(self._posted)):
                self._posted.popleft()()
            for timer in self._timers:
                timer.call(clock.now_ns())
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

    def _select(self) -> list[tuple[selectors.SelectorKey, int]]:
        """Sleep until a socket is readable, a call is posted or a timer is due."""
        until_s = self._until_due_s()
        self._sleeps = True
        try:
            # A call that is posted after this look finds ``_sleeps``, and wakes the loop.
            return self._selector.select(0 if self._posted else until_s)
        finally:
            self._sleeps = False

    def _until_due_s(self) -> float | None:
        if not self._timers:
            return None
        due = min(
            [timer.due_ns for timer in self._timers]
        )  # a list takes half of a generator's time
        return max(0, due - clock.now_ns()) / NS_PER_S

    def _wake(self) -> None:
        # A full socket already holds a wake-up; a closed one needs none.
        with contextlib.suppress(OSError):
            self._wake_in.send(b"\0")

    def _drain(self, _: int) -> None:
        with contextlib.suppress(BlockingIOError):
            self._wake_out.recv(65_536)  # the rest wakes the loop again
