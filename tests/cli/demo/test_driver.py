"""The driver of the lap: drive requests, calls, and their answers."""

import pytest

from cli.demo.driver import PRESS_NS, Driver
from cli.demo.script import Lap, Step, View, lap, still
from common import keys
from common import messages as m
from common.freshness import NS_PER_S
from common.motion import STILL, Twist
from tests.cli.demo.lap_fixture import odometry, safety
from tests.fake_bus import FakeBus


@pytest.fixture
def bus() -> FakeBus:
    return FakeBus()


def never(_: View, __: m.Odometry) -> bool:
    return False


RESET = Step("reset", still, lambda view, _: view.refusal is not None, "reset", latched=True)
RELEASE = Step("release", still, never, "release", latched=True)
DRIVE = Step("drive", lambda *_: Twist(0.5, 0.1), never)


def driver_of(bus: FakeBus, *steps: Step) -> tuple[Driver, list[str]]:
    """Return a driver at the start, and a list that collects the names of its steps."""
    started: list[str] = []
    driver = Driver(bus, Lap(steps), lambda step: started.append(step.name))
    driver.safety, driver.odometry = safety(), [odometry()]
    return driver, started


def newest_request(bus: FakeBus) -> m.Drive | None:
    """Return the newest drive request."""
    (source,) = (p for p in bus.publishers if p.topic is keys.DRIVE)
    assert source.key == "t2/v1/001/@cmd/drive/demo"
    return source.last


def test_no_request_before_the_first_messages(bus: FakeBus) -> None:
    driver = Driver(bus, Lap(lap(fast=True)), lambda _: None)
    driver.on_beat(0)
    driver.safety = safety()
    driver.on_beat(0)
    assert newest_request(bus) is None
    assert driver.lap.times_ns == []


def test_a_request_per_beat_and_one_start_per_step(bus: FakeBus) -> None:
    driver, started = driver_of(bus, DRIVE)
    for beat in range(3):
        driver.on_beat(beat)
    request = newest_request(bus)
    assert request is not None
    assert (request.linear, request.angular, request.seq) == (0.5, 0.1, 3)
    assert driver.requested == Twist(0.5, 0.1)
    assert started == ["drive"]
    assert bus.asked == []


def test_zero_is_requested_after_the_end(bus: FakeBus) -> None:
    driver, started = driver_of(bus)
    driver.on_beat(0)
    assert driver.requested == STILL
    assert started == []


def test_a_call_is_repeated_in_time_for_a_held_release(bus: FakeBus) -> None:
    driver, _ = driver_of(bus, RELEASE)
    for now_ns in (NS_PER_S, NS_PER_S + PRESS_NS - 1, NS_PER_S + PRESS_NS):
        driver.on_beat(now_ns)
    assert [path for path, _ in bus.asked] == [keys.RELEASE.path] * 2
    assert PRESS_NS < 0.3 * NS_PER_S


def test_a_refusal_ends_the_step_that_waits_for_it(bus: FakeBus) -> None:
    driver, started = driver_of(bus, RESET, DRIVE)
    driver.on_beat(NS_PER_S)
    ((path, _),) = bus.asked
    ((_, refuse),) = bus.answers
    assert path == keys.RESET.path
    refuse("still pressed")
    driver.on_beat(2 * NS_PER_S)
    assert started == ["reset", "drive"]
    assert driver.answers == [("reset", "reset", False, "still pressed")]


def test_a_late_answer_is_kept_and_ends_no_step(bus: FakeBus) -> None:
    driver, started = driver_of(bus, RESET, RESET, DRIVE)
    driver.on_beat(NS_PER_S)
    refuse = bus.answers[0][1]
    refuse("still pressed")
    driver.on_beat(2 * NS_PER_S)
    refuse("late")
    driver.on_beat(3 * NS_PER_S)
    assert started == ["reset", "reset"]
    assert [words for _, _, _, words in driver.answers] == ["still pressed", "late"]


def test_the_same_answer_again_is_started_once(bus: FakeBus) -> None:
    driver, _ = driver_of(bus, RELEASE)
    driver.on_beat(NS_PER_S)
    for _ in range(2):
        bus.answers[0][0](m.Done(text="creeping"))
    assert driver.answers == [("release", "release", True, "creeping")]
