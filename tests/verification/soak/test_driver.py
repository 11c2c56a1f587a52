"""The driver of a soak: recovery before driving, and restarted laps."""

import threading
from types import SimpleNamespace
from typing import Any, cast

import pytest

import t2
from cli.demo.driver import Driver, LapEndedError
from cli.demo.lap import QUICK, Pace
from cli.demo.record import LapRecord
from common import log
from common.errors import LinkError
from sim.requests import Asked, Place
from sim.sockets import Control
from sim.trace import Truth
from tests.cli.demo.lap_fixture import odometry, truth
from verification.soak import driver as soak
from verification.soak.driver import LocatedDriver, Operator, StepTimeout


class Vehicle:
    """The simulator's control socket and the robot, made up."""

    def __init__(self) -> None:
        self.done: list[Asked] = []
        self.poses: list[tuple[float, ...]] = []
        self.now = truth(0, x=1.0, y=2.0, heading=0.5)
        self.there = True
        self.boot = 5
        self.odometry = SimpleNamespace(latest=lambda: odometry(boot=self.boot))

    def do(self, request: Asked) -> None:
        if not self.there:
            raise LinkError("the simulator's control socket: timed out")
        self.done.append(request)

    def truth(self) -> Truth:
        if not self.there:
            raise LinkError("the simulator's control socket: timed out")
        return self.now

    def set_pose(self, *pose: float) -> None:
        self.poses.append(pose)


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle()


@pytest.fixture
def logged(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Collect the driver's events."""
    events: list[str] = []

    def keep(event: str, **_: object) -> None:
        events.append(event)

    logger = SimpleNamespace(info=keep, warning=keep)
    monkeypatch.setattr(log, "Logger", lambda: logger)
    return events


def located(vehicle: Vehicle) -> LocatedDriver:
    robot, control = cast("t2.Robot", vehicle), cast("Control", vehicle)
    return LocatedDriver(robot, LapRecord(), threading.Event(), control)


def operator(vehicle: Vehicle) -> Operator:
    return Operator(cast("t2.Robot", vehicle), cast("Control", vehicle), QUICK)


def test_the_pose_is_set_after_each_restart_of_odometry(vehicle: Vehicle) -> None:
    driver = located(vehicle)
    for boot in (5, 6):
        vehicle.boot = boot
        with pytest.raises(t2.NoData, match="was set"):
            driver.located()
        assert driver.located().boot == boot
    assert vehicle.poses == [(1.0, 2.0, 0.5)] * 2


def test_the_pose_of_a_moving_vehicle_is_not_set(vehicle: Vehicle) -> None:
    driver, standing = located(vehicle), vehicle.now
    vehicle.now = truth(0, linear=0.1)
    with pytest.raises(t2.NoData, match="moves"):
        driver.located()
    vehicle.there = False
    with pytest.raises(t2.NoData, match="timed out"):
        driver.located()
    assert vehicle.poses == []
    vehicle.now, vehicle.there = standing, True
    assert driver.pose().boot == 5


def test_a_lap_begins_at_the_start(
    vehicle: Vehicle, logged: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lap(driver: Driver, _: Pace) -> None:
        assert vehicle.done == [Place(x=0.0, y=0.0)]
        driver.record.step("only")

    monkeypatch.setattr(soak, "drive_lap", lap)
    operator(vehicle).drive()
    assert logged == ["step", "lap finished"]


@pytest.mark.parametrize("error", [LapEndedError(), LinkError("no control socket")])
def test_a_lap_that_is_stuck_is_begun_anew(
    vehicle: Vehicle, logged: list[str], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def lap(*_: Any) -> None:
        raise error

    monkeypatch.setattr(soak, "drive_lap", lap)
    monkeypatch.setattr(soak, "TRY_S", 0.0)
    operator(vehicle).drive()
    assert logged == ["begun anew"]


def test_a_step_expires_and_the_next_one_begins_anew(
    logged: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 100.0
    monkeypatch.setattr("verification.soak.driver.time.monotonic", lambda: now_s)
    timeout = StepTimeout(30.0)
    now_s = 129.0
    timeout.restart("first")
    now_s = 158.0
    assert not timeout.is_set()
    now_s = 160.0
    assert timeout.is_set()
    assert logged == ["step"]
