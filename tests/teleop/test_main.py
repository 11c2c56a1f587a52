"""The whole program in a pseudo terminal, near, far or stalled, on a real bus."""

import signal
import sys
import time
from collections.abc import Callable, Iterator

import pytest

from common import clock
from common.bus.bus import Arrival, Bus
from common.freshness import NS_PER_S
from common.loop import Loop
from services.teleop import __main__ as teleop
from t2 import keys
from t2.client import ZEROS
from t2.messages import Drive, Event, Health
from tests.teleop.terminal import STRICT, TELEOP, Terminal, terminal
from verification.harness.bus import bus_on, running
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

REPEAT_S = 0.033
FAR_S = 0.21  # each way: 0.42 s there and back


class Listener:
    """Records requested speeds with their times, teleop's events, presence and health."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, float]] = []
        self.events: list[str] = []
        self.alive: list[str] = []
        self.health: list[Health] = []

    def declare(self, bus: Bus) -> None:
        bus.subscribe(keys.DRIVE, self._on_drive, source="teleop", depth=64)
        bus.subscribe(keys.EVENTS, self._on_event, service="teleop")
        bus.subscribe(keys.HEALTH, lambda it: self.health.append(it.message), service="teleop")
        bus.watch_live(keys.live_key("001", "teleop", "*"), lambda key, up: self.alive.append(key))

    def _on_drive(self, arrival: Arrival[Drive]) -> None:
        self.asked.append((arrival.received_ns, arrival.message.linear))

    def _on_event(self, arrival: Arrival[Event]) -> None:
        self.events.append(arrival.message.name)

    @property
    def speeds(self) -> set[float]:
        return {linear for _, linear in self.asked}

    @property
    def zeros(self) -> int:
        """The number of zeros at the end."""
        moving = [i for i, (_, linear) in enumerate(self.asked) if linear]
        return len(self.asked) - 1 - moving[-1]

    def moves_after(self, since_ns: int) -> float:
        """Return how long after a moment the last request to move came; 0 if none came."""
        return max((at - since_ns for at, linear in self.asked if linear), default=0) / NS_PER_S


@pytest.fixture
def listener(shared_router: str) -> Iterator[Listener]:
    listener = Listener()
    with running(Loop()) as loop, bus_on(shared_router, loop, listener.declare):
        yield listener


def ready(it: Terminal, listener: Listener) -> None:
    """Wait for the screen and for the connection through the bus."""

    def zero() -> bool:
        it.type(" ")
        it.read()
        return bool(listener.asked)

    wait_until(lambda: it.shows(b"ESTOP"), "the screen")
    wait_until(zero, "a zero: the way through the bus is open")


def hold(it: Terminal, seconds: float, done: Callable[[], bool] = lambda: False) -> int:
    """Hold W with a keyboard's repeats; return the time of its release."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not done():
        it.type("w")
        time.sleep(REPEAT_S)
    return clock.now_ns()


def test_an_emergency_stop_without_a_router_is_reported_after_quitting() -> None:
    with terminal(f"tcp/127.0.0.1:{free_port()}") as it:
        wait_until(lambda: it.shows(b"ESTOP"), "the screen")
        it.type("e")
        it.type("q")
        wait_until(it.ends, "its end")
        assert it.process.returncode == 1
        it.read()
        assert b"EMERGENCY STOP NOT CONFIRMED" in it.shown


def drive_off(it: Terminal, listener: Listener) -> None:
    """Hold W until a request to move is sent; release it for a while before a further try."""

    def moves() -> bool:
        hold(it, 1.0, lambda: 0.2 in listener.speeds)
        if 0.2 not in listener.speeds:
            time.sleep(1.0)
        return 0.2 in listener.speeds

    ready(it, listener)
    wait_until(moves, "a request to move")
    assert listener.speeds == {0.0, 0.2}


@pytest.mark.parametrize(
    ("end", "code"),
    [
        (Terminal.hang_up, teleop.EXIT_HANGUP),
        (lambda it: it.process.send_signal(signal.SIGTERM), 0),
    ],
)
def test_a_release_and_every_end_send_zeros_and_then_nothing(
    shared_router: str, listener: Listener, end: Callable[[Terminal], None], code: int
) -> None:
    # Of the three zeros Zenoh drops some on a busy host.
    with terminal(shared_router, *TELEOP, delay_s=0.05) as it:
        drive_off(it, listener)
        released_ns = hold(it, 0.5)
        wait_until(lambda: listener.zeros, "a zero of the release")
        assert listener.moves_after(released_ns) < 1.0
        assert it.process.poll() is None
        wait_until(lambda: listener.health, "health")
        time.sleep(0.5)  # until all of the release have come
        end_ns = clock.now_ns()
        end(it)
        wait_until(it.ends, "its end")
        assert it.process.returncode == code
    wait_until(lambda: listener.asked[-1][0] > end_ns, "a zero of the end")
    assert listener.zeros <= 2 * ZEROS
    assert listener.alive
    assert {health.service for health in listener.health} == {"teleop"}


# --- slow terminals -------------------------------------------------------------------------


def test_a_far_terminal_does_not_drive_and_its_estop_counts(
    shared_router: str, listener: Listener
) -> None:
    with terminal(shared_router, *STRICT, delay_s=FAR_S) as it:
        ready(it, listener)
        hold(it, 1.5)
        wait_until(lambda: it.shows(b"KEYBOARD OFF: Terminal too slow: 0.4"), "the reason")
        assert listener.speeds == {0.0}
        it.type("e")
        wait_until(lambda: "estop" in listener.events, "the emergency stop")


def test_keys_that_a_stall_held_up_do_not_drive(shared_router: str, listener: Listener) -> None:
    with terminal(shared_router, *STRICT, delay_s=0.02) as it:
        drive_off(it, listener)
        it.stall(1.2)
        released_ns = hold(it, 0.3)
        time.sleep(1.2)
    assert listener.moves_after(released_ns) < 0.8  # they arrive after 0.9 s


# --- keyboards --------------------------------------------------------------------------------


@pytest.mark.parametrize("typed", ["у", "ｅ", "\x1b[1091::101;;1091u", "\x1b[1::2:3u\x1b[101u"])
def test_an_emergency_stop_from_another_keyboard(
    shared_router: str, listener: Listener, typed: str
) -> None:
    with terminal(shared_router) as it:
        ready(it, listener)
        it.type("ц")
        wait_until(lambda: it.shows(b"SWITCH THE KEYBOARD TO LATIN"), "the notice")
        it.type(typed)
        wait_until(lambda: "estop" in listener.events, "the emergency stop")


# --- the start ------------------------------------------------------------------------------


def test_a_missing_terminal_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(teleop, "terminal_is_there", lambda: False)
    assert teleop.main([]) == 1
    assert "needs a terminal" in capsys.readouterr().err


def test_an_invalid_setting_ends_the_start(capsys: pytest.CaptureFixture[str]) -> None:
    assert teleop.main(["--source", "No Name"]) == 78
    assert "teleop.source" in capsys.readouterr().err


def test_a_missing_extra_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(teleop, "terminal_is_there", lambda: True)
    monkeypatch.delitem(sys.modules, "services.teleop.app", raising=False)
    monkeypatch.setitem(sys.modules, "textual", None)
    assert teleop.main(["--no-gamepad"]) == 1
    assert "install the extra `teleop`" in capsys.readouterr().err
