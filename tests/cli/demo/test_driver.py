"""The driver at the wheel: asks at every beat, presses buttons, keeps what is answered."""

from collections.abc import Callable
from typing import Any

import pytest

from cli.demo.driver import PRESS_NS, Driver
from cli.demo.script import Lap, Step, View, lap, still
from common import keys
from common import messages as m
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.motion import STILL, Twist
from tests.cli.demo.lap_fixture import odometry, safety
from verification.harness.support import at


class Desk(Bus):
    """A bus without a router, whose calls are answered by hand."""

    def __init__(self) -> None:
        super().__init__(at("tcp/127.0.0.1:1"), "001", lambda call: call())
        self.asked: list[tuple[str, Callable[[Any], None], Callable[[str], None]]] = []

    def ask(
        self,
        call: keys.Call[Any, Any],
        request: Any,
        on_reply: Callable[[Any], None],
        on_refusal: Callable[[str], None],
        timeout_s: float = 2.0,
    ) -> None:
        self.asked.append((call.path, on_reply, on_refusal))


@pytest.fixture
def desk() -> Desk:
    return Desk()


def never(_: View, __: m.Odometry) -> bool:
    return False


RESET = Step("reset", still, lambda view, _: view.refusal is not None, "reset", latched=True)
RELEASE = Step("release", still, never, "release", latched=True)
DRIVE = Step("drive", lambda *_: Twist(0.5, 0.1), never)


def driver_of(desk: Desk, *steps: Step) -> tuple[Driver, list[str]]:
    """Return a driver who sees safety and the start, and the names of the steps that begin."""
    told: list[str] = []
    driver = Driver(desk, Lap(steps), lambda step: told.append(step.name))
    driver.safety, driver.odometry = safety(), [odometry()]
    return driver, told


def asked_for(desk: Desk) -> m.Drive | None:
    """Return the newest request to move."""
    (source,) = (p for p in desk.publishers if p.topic is keys.DRIVE)
    assert source.key == "t2/v1/001/@cmd/drive/demo"
    return source.last


def test_nothing_is_asked_before_anything_is_seen(desk: Desk) -> None:
    driver = Driver(desk, Lap(lap(fast=True)), lambda _: None)
    driver.on_beat(0)
    driver.safety = safety()
    driver.on_beat(0)
    assert asked_for(desk) is None
    assert driver.lap.times_ns == []


def test_every_beat_asks_and_a_step_is_told_once(desk: Desk) -> None:
    driver, told = driver_of(desk, DRIVE)
    for beat in range(3):
        driver.on_beat(beat)
    request = asked_for(desk)
    assert request is not None
    assert (request.linear, request.angular, request.seq) == (0.5, 0.1, 3)
    assert driver.asked == Twist(0.5, 0.1)
    assert told == ["drive"]
    assert desk.asked == []


def test_after_the_end_zero_is_asked(desk: Desk) -> None:
    driver, told = driver_of(desk)
    driver.on_beat(0)
    assert driver.asked == STILL
    assert told == []


def test_a_button_is_pressed_again_in_time_for_a_held_release(desk: Desk) -> None:
    driver, _ = driver_of(desk, RELEASE)
    for now_ns in (NS_PER_S, NS_PER_S + PRESS_NS - 1, NS_PER_S + PRESS_NS):
        driver.on_beat(now_ns)
    assert [path for path, _, _ in desk.asked] == [keys.RELEASE.path] * 2
    assert PRESS_NS < 0.3 * NS_PER_S


def test_a_refusal_moves_on_the_step_that_waits_for_it(desk: Desk) -> None:
    driver, told = driver_of(desk, RESET, DRIVE)
    driver.on_beat(NS_PER_S)
    ((path, _, refuse),) = desk.asked
    assert path == keys.RESET.path
    refuse("still pressed")
    driver.on_beat(2 * NS_PER_S)
    assert told == ["reset", "drive"]
    assert driver.answers == [("reset", "reset", False, "still pressed")]


def test_an_answer_that_comes_after_its_step_is_kept_and_moves_nothing(desk: Desk) -> None:
    driver, told = driver_of(desk, RESET, RESET, DRIVE)
    driver.on_beat(NS_PER_S)
    refuse = desk.asked[0][2]
    refuse("still pressed")
    driver.on_beat(2 * NS_PER_S)
    refuse("late")
    driver.on_beat(3 * NS_PER_S)
    assert told == ["reset", "reset"]
    assert [words for _, _, _, words in driver.answers] == ["still pressed", "late"]


def test_the_same_answer_again_is_told_once(desk: Desk) -> None:
    driver, _ = driver_of(desk, RELEASE)
    driver.on_beat(NS_PER_S)
    for _ in range(2):
        desk.asked[0][1](m.Done(text="creeping"))
    assert driver.answers == [("release", "release", True, "creeping")]
