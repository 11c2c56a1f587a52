"""The driver of the lap: it goes on after stops, and counts latches; in simulated time."""

import math
import threading
from collections.abc import Callable

import pytest

import t2
from cli.demo.driver import Driver, LapEndedError
from cli.demo.record import LapRecord
from sim.requests import Bumper, Sonar
from tests.simulated_robot import SimulatedStack, simulated_robot


class Vehicle:
    """A driver in an empty world, and its stack."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.stack, self.record = SimulatedStack("empty"), LapRecord(steps=["step"])
        self.ended = threading.Event()
        self.driver = Driver(simulated_robot(self.stack, patch), self.record, self.ended)
        self.driver.wait()

    def block(self, distance: float | None) -> None:
        """Make the front sonar report an obstacle, or none."""
        self.stack.vehicle.inject(Sonar(name="front", range=distance))

    @property
    def x(self) -> float:
        return self.driver.pose().x

    def when(self, true: Callable[[], bool], act: Callable[[], object]) -> None:
        """Act once, as soon as a condition is true."""

        def beat() -> None:
            if true():
                self.stack.each_beat.remove(beat)
                act()

        self.stack.each_beat.append(beat)

    def has_moved(self, distance: float) -> Callable[[], bool]:
        return lambda: self.stack.poses[-1].x >= distance

    def after(self, seconds: float) -> Callable[[], bool]:
        end_ns = self.stack.net.now_ns + seconds * 1e9
        return lambda: self.stack.net.now_ns >= end_ns


@pytest.fixture
def vehicle(monkeypatch: pytest.MonkeyPatch) -> Vehicle:
    return Vehicle(monkeypatch)


def test_a_distance_and_an_angle(vehicle: Vehicle) -> None:
    vehicle.driver.forward(1.0, 0.5)
    assert vehicle.x == pytest.approx(1.0, abs=0.03)
    vehicle.driver.turn(math.pi / 2, 0.8)
    assert vehicle.driver.pose().heading == pytest.approx(math.pi / 2, abs=0.04)
    vehicle.driver.forward(-0.5, 0.5)
    assert vehicle.driver.pose().y == pytest.approx(-0.5, abs=0.03)


def test_an_unplanned_latch_is_reset_and_counted_and_the_motion_goes_on(vehicle: Vehicle) -> None:
    vehicle.when(vehicle.has_moved(0.5), vehicle.stack.estop)
    vehicle.driver.forward(1.0, 0.5)
    assert vehicle.record.unplanned == ["estop"]
    assert vehicle.x == pytest.approx(1.0, abs=0.03)
    vehicle.when(vehicle.has_moved(1.5), vehicle.stack.estop)
    vehicle.driver.forward(1.0, 0.5)
    assert vehicle.record.unplanned == ["estop", "estop"]


def test_a_motion_waits_for_an_obstacle_to_leave(vehicle: Vehicle) -> None:
    vehicle.block(0.2)
    leaves = vehicle.after(4.0)
    vehicle.when(leaves, lambda: vehicle.block(None))
    vehicle.driver.forward(1.0, 0.5)
    assert leaves()
    assert vehicle.x == pytest.approx(1.0, abs=0.03)
    assert vehicle.record.unplanned == []


def test_an_expected_cause_ends_the_motion(vehicle: Vehicle) -> None:
    vehicle.when(vehicle.has_moved(0.5), vehicle.stack.estop)
    with pytest.raises(t2.Latched):
        vehicle.driver.forward(5.0, 0.5, expected="estop")
    assert vehicle.record.unplanned == []
    vehicle.driver.reset()
    assert vehicle.record.answers[-1][:2] == ("step", True)
    vehicle.block(0.2)
    with pytest.raises(t2.Blocked):
        vehicle.driver.forward(5.0, 0.5, expected="blocked")


def test_a_refused_call_is_repeated_and_its_answer_kept_once(vehicle: Vehicle) -> None:
    vehicle.stack.vehicle.inject(Bumper(pressed=True))
    vehicle.stack.estop()
    vehicle.when(vehicle.after(8.0), vehicle.ended.set)
    with pytest.raises(LapEndedError):
        vehicle.driver.release("backward")
    assert [granted for _, granted, _ in vehicle.record.answers] == [False]


def test_the_end_ends_what_waits(vehicle: Vehicle) -> None:
    vehicle.block(0.2)
    vehicle.when(vehicle.after(4.0), vehicle.ended.set)
    with pytest.raises(LapEndedError):
        vehicle.driver.forward(1.0, 0.5)
    assert vehicle.stack.each_beat == []  # no drive is left
