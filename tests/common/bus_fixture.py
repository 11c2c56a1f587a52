"""Buses of one robot on a real router, with a loop in a thread for their handlers."""

import contextlib
import threading
from collections.abc import Callable, Iterable, Iterator
from itertools import count
from types import TracebackType
from typing import Self

import zenoh

from common.bus.bus import Bus
from common.bus.session import client_config
from common.loop import Loop
from verification.harness.bus import at, running
from verification.harness.waiting import wait_until

_robots = count(1)


@contextlib.contextmanager
def stalled(loop: Loop) -> Iterator[None]:
    """Stall a running loop in a handler while the context lasts."""
    held, go_on = threading.Event(), threading.Event()

    def hold() -> None:
        held.set()
        go_on.wait(20)

    loop.post(hold)
    assert held.wait(20)
    try:
        yield
    finally:
        go_on.set()


class BusFixture:
    """Opens what a test needs on the bus and closes it at the end."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.robot = f"r{next(_robots)}"
        self.loop = Loop()
        self._stack = contextlib.ExitStack()
        self._running = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._running.enter_context(running(self.loop))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._running.close()  # first, for its timers put on the sessions
        self._stack.close()

    def bus(self, declare: Callable[[Bus], object] = lambda _: None) -> Bus:
        """Open a bus with these declarations; it is connected on return."""
        bus = Bus(at(self.endpoint), self.robot, self.loop.post)
        declare(bus)
        return self.opened(bus)

    def opened(self, bus: Bus) -> Bus:
        """Open a bus that has its declarations; it is connected on return."""
        bus.open()
        self.loop.post(lambda: self.loop.every(0.01, lambda _: bus.answer_queries()))
        self._stack.callback(bus.close)
        wait_until(lambda: bus.connected, "a session with the router")
        return bus

    def stalled(self) -> contextlib.AbstractContextManager[None]:
        """Stall the loop while the context lasts."""
        return stalled(self.loop)

    def session(self) -> zenoh.Session:
        """Open a bare session, as a stranger would."""
        session: zenoh.Session = self._stack.enter_context(
            zenoh.open(client_config(at(self.endpoint)))
        )
        return session


def until_received(put: Callable[[], object], received: Callable[[], object], what: str) -> None:
    """Publish repeatedly until received: samples sent before all declarations are lost."""

    def once() -> object:
        put()
        return received()

    wait_until(once, what)


def rising(numbers: Iterable[int]) -> bool:
    """Return whether each number is greater than the one before."""
    found = list(numbers)
    return found == sorted(set(found))
