"""Event loop of a service: sockets, timers, and calls from other threads, one at a time.

A handler runs only in the thread that holds the loop's lock, so that the cores need no locks of
their own. The loop's thread holds it except while it sleeps. Then another thread may ``submit`` a
call and run it at once, without waking the loop's thread: ``docs/decisions.md#one-thread-decides``.
"""

import contextlib
import selectors
import socket
import threading
from collections import deque
from collections.abc import Callable

from msgspec import Struct

from common import clock
from common.freshness import NS_PER_S

AT_ONCE_MAX = 4  # submitted calls that one sender makes; more are the loop's

Handler = Callable[[int], object]  # takes the monotonic time in nanoseconds
Call = Callable[[], object]


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
    """Runs handlers as they become due, until ``stop``.

    Its lock is held from the start, and after ``run``: nothing runs beside the construction and the
    exit of a service.
    """

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._timers: list[Timer] = []
        self._posted: deque[Call] = deque()  # for the loop's thread
        self._submitted: deque[Call] = deque()  # for the thread that holds the lock
        self._wake_in, self._wake_out = socket.socketpair()
        self._wake_in.setblocking(False)
        self._wake_out.setblocking(False)
        self._selector.register(self._wake_out, selectors.EVENT_READ, self._drain)
        self._stopped = False
        self._error: BaseException | None = None  # of a submitted call, for the loop's thread
        self._lock = threading.Lock()
        self._holder = 0  # thread id; 0 while the lock is free
        self._acquire()

    @property
    def held(self) -> bool:
        """Whether the calling thread holds the lock: it may call a core."""
        return self._holder == threading.get_ident()

    def watch(self, sock: socket.socket, handler: Handler) -> None:
        """Call the handler whenever the socket is readable."""
        self._selector.register(sock, selectors.EVENT_READ, handler)

    def every(self, period_s: float, handler: Handler) -> Timer:
        """Call the handler every ``period_s`` seconds, the first time at once.

        Like ``watch``, call it before ``run`` or in a handler; other threads use ``post``.
        """
        timer = Timer(round(period_s * NS_PER_S), clock.now_ns(), handler)
        self._timers.append(timer)
        self._wake()  # the handler that calls this may run in another thread
        return timer

    def post(self, call: Call) -> None:
        """Queue a call from any thread; the loop's thread makes it."""
        self._posted.append(call)
        self._wake()

    def submit(self, call: Call) -> None:
        """Make a call from any thread: at once in this thread if the lock is free.

        Otherwise the thread that holds it makes the call, or wakes the loop's thread for it. This
        never waits for the lock: a caller that waited would stamp its next sample too late.
        """
        self._submitted.append(call)
        if not self._lock.acquire(blocking=False):
            return
        self._holder = threading.get_ident()
        try:
            if self._error is None:
                self._make(self._submitted, AT_ONCE_MAX)
        except BaseException as error:  # ``run`` raises it in the loop's thread
            self._error = error
            self._wake()
        finally:
            self._release()
        # Calls that arrived meanwhile are the loop's: this thread must return to its samples.
        if self._submitted:
            self._wake()

    def stop(self) -> None:
        """Make ``run`` return after the current call; safe in a signal handler."""
        self._stopped = True
        self._wake()

    def run(self) -> None:
        """Run until ``stop``, which may precede this call; may be run again after that.

        Raise the error of a submitted call.
        """
        self._holder = threading.get_ident()
        while not self._stopped:
            ready = self._select()
            if self._error is not None:
                raise self._error
            for key, _ in ready:
                key.data(clock.now_ns())
            # Calls of other threads first: timers check the age of data.
            self._make(self._posted)
            self._make(self._submitted)
            self._call_due()
        self._stopped = False

    def hold(self, timeout_s: float) -> None:
        """Keep all other threads from making calls, for the end of the process.

        For a signal handler: it may have interrupted the thread that holds the lock.
        """
        if not self.held and self._lock.acquire(timeout=timeout_s):
            self._holder = threading.get_ident()

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
        """Sleep without the lock until a socket is readable or a timer is due."""
        until_s = self._until_due_s()
        self._release()
        try:
            # A call submitted after this check finds the lock free.
            return self._selector.select(0 if self._submitted else until_s)
        finally:
            self._acquire()

    def _acquire(self) -> None:
        self._lock.acquire()
        self._holder = threading.get_ident()

    def _release(self) -> None:
        self._holder = 0
        self._lock.release()

    def _until_due_s(self) -> float | None:
        if not self._timers:
            return None
        due = min(timer.due_ns for timer in self._timers)
        return max(0, due - clock.now_ns()) / NS_PER_S

    def _call_due(self) -> None:
        for timer in self._timers:
            timer.call(clock.now_ns())

    def _wake(self) -> None:
        # A full socket already holds a wake-up; a closed one needs none.
        with contextlib.suppress(OSError):
            self._wake_in.send(b"\0")

    def _drain(self, _: int) -> None:
        with contextlib.suppress(BlockingIOError):
            self._wake_out.recv(65_536)  # the rest wakes the loop again

    def _make(self, calls: deque[Call], most: int | None = None) -> None:
        count = len(calls)
        for _ in range(count if most is None else min(count, most)):
            calls.popleft()()
