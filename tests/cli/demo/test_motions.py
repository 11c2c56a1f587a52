"""Motions of the lap: they go on after stops, and count latches; in simulated time."""

import math
from collections.abc import Callable

import pytest

import t2
from cli.demo.lap import QUICK, Lap
from sim.requests import Bumper, Sonar
from tests.simulated_robot import SimulatedStack, simulated_robot


class EndedError(Exception):
    """The test ended the lap."""


class Vehicle:
    """A lap in an empty world, and its stack."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.stack = SimulatedStack("empty")
        self.ended = False
        self.answers: list[str] = []
        self.lap = Lap(
            simulated_robot(self.stack, patch), QUICK, check=self.check,
            show=lambda _, answer: self.answers.append(answer),
        )  # fmt: skip
        self.lap.steps.append("step")
        self.lap._motion(lambda _: None)

    def check(self) -> None:
        if self.ended:
            raise EndedError

    def end(self) -> None:
        self.ended = True

    def block(self, distance: float | None) -> None:
        """Make the front sonar report an obstacle, or none."""
        self.stack.vehicle.inject(Sonar(name="front", range=distance))

    @property
    def x(self) -> float:
        return self.lap._pose().x

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
    vehicle.lap._forward(1.0, 0.5)
    assert vehicle.x == pytest.approx(1.0, abs=0.03)
    vehicle.lap._turn(math.pi / 2)
    assert vehicle.lap._pose().heading == pytest.approx(math.pi / 2, abs=0.04)
    vehicle.lap._forward(-0.5, 0.5)
    assert vehicle.lap._pose().y == pytest.approx(-0.5, abs=0.03)


def test_an_unplanned_latch_is_reset_and_counted_and_the_motion_goes_on(vehicle: Vehicle) -> None:
    vehicle.when(vehicle.has_moved(0.5), vehicle.stack.estop)
    vehicle.lap._forward(1.0, 0.5)
    assert vehicle.lap.unplanned == ["estop"]
    assert vehicle.x == pytest.approx(1.0, abs=0.03)


def test_a_motion_waits_for_an_obstacle_to_leave(vehicle: Vehicle) -> None:
    vehicle.block(0.2)
    leaves = vehicle.after(4.0)
    vehicle.when(leaves, lambda: vehicle.block(None))
    vehicle.lap._forward(1.0, 0.5)
    assert leaves()
    assert vehicle.x == pytest.approx(1.0, abs=0.03)
    assert vehicle.lap.unplanned == []


def test_an_expected_cause_ends_the_motion(vehicle: Vehicle) -> None:
    vehicle.when(vehicle.has_moved(0.5), vehicle.stack.estop)
    with pytest.raises(t2.Latched):
        vehicle.lap._forward(5.0, 0.5, expected="estop")
    assert vehicle.lap.unplanned == []


def test_a_refused_call_is_repeated_and_its_answer_shown_once(vehicle: Vehicle) -> None:
    vehicle.stack.vehicle.inject(Bumper(pressed=True))
    vehicle.stack.estop()
    vehicle.when(vehicle.after(8.0), vehicle.end)
    with pytest.raises(EndedError):
        vehicle.lap._repeat(lambda: vehicle.lap._robot.release("backward", "teleop"))
    assert [answer.partition(":")[0] for answer in vehicle.answers] == ["refused"]


def test_the_check_ends_what_waits(vehicle: Vehicle) -> None:
    vehicle.block(0.2)
    vehicle.when(vehicle.after(4.0), vehicle.end)
    with pytest.raises(EndedError):
        vehicle.lap._forward(1.0, 0.5)
    assert vehicle.stack.each_beat == []  # no drive is left
