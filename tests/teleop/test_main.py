"""The whole program in a pseudo terminal, on a real bus."""

import signal
import sys
from collections.abc import Callable, Iterator

import pytest

from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import Drive, Health
from services.teleop import __main__ as teleop
from verification.harness.bus import bus_on, running
from verification.harness.ports import free_port
from verification.harness.teleop_terminal import Terminal, terminal
from verification.harness.waiting import wait_until


@pytest.fixture
def loop() -> Iterator[Loop]:
    with running(Loop()) as loop:
        yield loop


@pytest.fixture
def requests() -> list[Drive]:
    return []


@pytest.fixture
def bus(endpoint: str, loop: Loop, requests: list[Drive]) -> Iterator[Bus]:
    def hear(arrival: Arrival[Drive]) -> None:
        requests.append(arrival.message)

    with bus_on(
        endpoint, loop, lambda bus: bus.subscribe(keys.DRIVE, hear, source="teleop", depth=64)
    ) as bus:
        yield bus


def drive_off(it: Terminal, requests: list[Drive]) -> None:
    """Hold W until a drive request is sent."""

    def hold(key: str) -> bool:
        it.type(key)
        it.read()
        return any((request.linear > 0) == (key == "w") for request in requests)

    wait_until(lambda: it.shows(b"ESTOP"), "the screen")
    wait_until(lambda: hold(" "), "a zero: the way through the bus is open")
    wait_until(lambda: hold("w"), "a request to move")
    assert {request.linear for request in requests} == {0.0, 0.2}


def zeros(requests: list[Drive]) -> int:
    """Return the number of zeros at the end."""
    moving = [i for i, request in enumerate(requests) if request.linear]
    return len(requests) - 1 - moving[-1]


def hang_up(it: Terminal) -> None:
    it.hang_up()


def terminate(it: Terminal) -> None:
    it.process.send_signal(signal.SIGTERM)


def leave(it: Terminal) -> None:
    it.type("q")


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize(
    ("end", "code"), [(hang_up, teleop.EXIT_HANGUP), (terminate, 0), (leave, 0)]
)
def test_every_end_sends_zeros_and_then_nothing(
    endpoint: str, requests: list[Drive], end: Callable[[Terminal], None], code: int
) -> None:
    with terminal(endpoint) as it:
        drive_off(it, requests)
        end(it)
        wait_until(it.ends, "its end")
        assert it.process.returncode == code
        wait_until(lambda: zeros(requests) >= 3, "zeros")
    assert 3 <= zeros(requests) <= 5  # a hold that ran out just before adds to them


@pytest.mark.usefixtures("bus")
def test_a_release_sends_zeros_and_then_nothing(endpoint: str, requests: list[Drive]) -> None:
    with terminal(endpoint) as it:
        drive_off(it, requests)
        wait_until(lambda: zeros(requests) >= 3, "zeros")
        assert it.process.poll() is None
        it.type("q")
        wait_until(it.ends, "its end")
    assert zeros(requests) == 6  # three for the release, three for the end: silence in between


def test_presence_and_health_are_on_the_bus(endpoint: str, loop: Loop) -> None:
    alive: list[str] = []
    health: list[Health] = []

    def declare(bus: Bus) -> None:
        bus.subscribe(keys.HEALTH, lambda it: health.append(it.message), service="teleop")
        bus.watch_live(keys.live_key("001", "teleop", "*"), lambda key, up: alive.append(key))

    with bus_on(endpoint, loop, declare), terminal(endpoint):
        wait_until(lambda: alive and health, "presence and health")
    assert health[0].service == "teleop"


def test_a_missing_router_is_shown() -> None:
    with terminal(f"tcp/127.0.0.1:{free_port()}") as it:
        wait_until(lambda: it.shows(b"no router yet"), "the words")
        it.type("q")
        wait_until(it.ends, "its end")
        assert it.process.returncode == 0


def test_a_missing_terminal_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(teleop, "terminal_is_there", lambda: False)
    assert teleop.main([]) == 1
    assert "needs a terminal" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--set", "teleop.hold=9"], "teleop.hold"),
        (["--source", "No Name"], "teleop.source"),
        (["--robot", "a/b"], "robot.id"),
    ],
)
def test_an_invalid_setting_ends_the_start(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert teleop.main(words) == 78
    assert named in capsys.readouterr().err


def test_a_missing_extra_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(teleop, "terminal_is_there", lambda: True)
    monkeypatch.delitem(sys.modules, "services.teleop.app", raising=False)
    monkeypatch.setitem(sys.modules, "textual", None)
    assert teleop.main(["--no-gamepad"]) == 1
    assert "install the extra `teleop`" in capsys.readouterr().err
