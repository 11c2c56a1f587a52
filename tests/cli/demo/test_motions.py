"""Motions of the lap: they go on after stops, and count latches; in simulated time."""

from collections.abc import Callable

import pytest

from cli.demo.lap import QUICK, Lap
from sim.requests import Sonar
from tests.simulated_robot import SimulatedStack, simulated_robot


class Vehicle:
    """A lap in an empty world, and its stack."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.stack = SimulatedStack("empty")
        self.lap = Lap(
            simulated_robot(self.stack, patch), QUICK, check=lambda: None, show=lambda *_: None,
        )  # fmt: skip
        self.lap.steps.append("step")
        self.lap._motion(lambda _: None)

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
