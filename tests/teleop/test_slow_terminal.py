"""Held keys on a slow terminal: the real program on a real bus."""

import time
from collections.abc import Callable, Iterator

import pytest

from common import clock, keys
from common.bus.bus import Arrival, Bus
from common.freshness import NS_PER_S
from common.loop import Loop
from common.messages import Drive, Event
from verification.harness.bus import bus_on, running
from verification.harness.teleop_terminal import STRICT, TELEOP, Terminal, terminal
from verification.harness.waiting import wait_until

REPEAT_S = 0.033
FAR_S = 0.21  # each way: 0.42 s there and back


@pytest.fixture
def loop() -> Iterator[Loop]:
    with running(Loop()) as loop:
        yield loop


class Listener:
    """Records the requested speeds with their times, and teleop's events."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, float]] = []
        self.events: list[str] = []

    def hear(self, arrival: Arrival[Drive]) -> None:
        self.asked.append((arrival.received_ns, arrival.message.linear))

    def note(self, arrival: Arrival[Event]) -> None:
        self.events.append(arrival.message.name)

    def moving_after_s(self, since_ns: int) -> float | None:
        """Return how long after a moment the last request to move came; None if none came."""
        late = [at for at, linear in self.asked if linear and at > since_ns]
        return (late[-1] - since_ns) / NS_PER_S if late else None


@pytest.fixture
def listener(endpoint: str, loop: Loop) -> Iterator[Listener]:
    listener = Listener()

    def declare(bus: Bus) -> None:
        bus.subscribe(keys.DRIVE, listener.hear, source="teleop", depth=64)
        bus.subscribe(keys.EVENTS, listener.note, service="teleop")

    with bus_on(endpoint, loop, declare):
        yield listener


def hold(it: Terminal, seconds: float, done: Callable[[], bool] = lambda: False) -> int:
    """Hold W with a keyboard's repeats; return the time of its release."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not done():
        it.type("w")
        time.sleep(REPEAT_S)
    return clock.now_ns()


def ready(it: Terminal, listener: Listener) -> None:
    """Wait for the screen and for the connection through the bus."""

    def zero() -> bool:
        it.type(" ")
        it.read()
        return bool(listener.asked)

    wait_until(lambda: it.shows(b"ESTOP"), "the screen")
    wait_until(zero, "a zero: the way through the bus is open")


def drives(it: Terminal, listener: Listener) -> bool:
    """Hold W for a while; release it if no drive request is sent."""

    def moving() -> bool:
        return any(linear for _, linear in listener.asked)

    hold(it, 1.0, moving)
    if not moving():
        time.sleep(1.0)
    return moving()


@pytest.mark.parametrize("delay_s", [0.0, 0.05])
def test_a_near_terminal_drives_and_its_release_counts(
    endpoint: str, listener: Listener, delay_s: float
) -> None:
    with terminal(endpoint, *TELEOP, delay_s=delay_s) as it:
        ready(it, listener)
        time.sleep(0.5)
        released_ns = hold(it, 1.5)
        time.sleep(1.5)
    late_s = listener.moving_after_s(released_ns)
    assert late_s is not None
    assert late_s < 0.45 + delay_s


def test_a_far_terminal_does_not_drive_and_its_estop_counts(
    endpoint: str, listener: Listener
) -> None:
    with terminal(endpoint, *STRICT, delay_s=FAR_S) as it:
        ready(it, listener)
        hold(it, 1.5)
        time.sleep(2.0)
        assert not any(linear for _, linear in listener.asked)
        assert it.shows(b"KEYS OFF: terminal too slow: 0.4")
        it.type("e")
        wait_until(lambda: "estop" in listener.events, "the emergency stop")


def test_keys_that_a_stall_held_up_do_not_drive(endpoint: str, listener: Listener) -> None:
    with terminal(endpoint, *STRICT, delay_s=0.02) as it:
        ready(it, listener)
        time.sleep(1.5)
        wait_until(lambda: drives(it, listener), "a request to move")
        it.stall(1.2)
        released_ns = hold(it, 0.3)
        time.sleep(2.5)
    late_s = listener.moving_after_s(released_ns)
    assert late_s is None or late_s < 0.4


def test_a_terminal_that_never_answers_does_not_drive(endpoint: str, listener: Listener) -> None:
    with terminal(endpoint, *STRICT, answers=False) as it:
        ready(it, listener)
        hold(it, 1.0)
        time.sleep(0.5)
        assert not any(linear for _, linear in listener.asked)
