"""The driver of a soak: recovery before driving, and restarted laps."""

import math
from typing import Any, cast

import pytest

from cli.demo.script import QUICK, lap
from common import keys
from common import messages as m
from common.errors import LinkError
from common.freshness import NS_PER_S
from sim.requests import Asked, Place
from sim.sockets import Control
from sim.trace import Truth
from tests.cli.demo.lap_fixture import odometry, safety, truth
from tests.fake_bus import FakeBus
from verification.soak.driver import OLD_NS, STEP_S, TRY_NS, Operator

BEAT_NS = NS_PER_S // 20


class Vehicle:
    """The simulator's control socket, made up."""

    def __init__(self) -> None:
        self.done: list[Asked] = []
        self.now = truth(0)
        self.there = True

    def do(self, request: Asked) -> None:
        if not self.there:
            raise LinkError("the simulator's control socket: timed out")
        self.done.append(request)

    def truth(self) -> Truth:
        return self.now


class DriverFixture:
    """An operator, his bus and his vehicle, at a clock of their own."""

    def __init__(self) -> None:
        self.bus, self.vehicle, self.now_ns = FakeBus(), Vehicle(), 100 * NS_PER_S
        self.operator = Operator(self.bus, cast("Control", self.vehicle), QUICK)
        self.driver = self.operator._driver
        self.driver.safety = safety("neutral")

    def beat(self, seconds: float = 0.0, boot: int = 5, verdict: m.Verdict = "run") -> None:
        """Beat for so long, at least once, with a pose that is always young."""
        end_ns = self.now_ns + round(seconds * NS_PER_S)
        while True:
            self.now_ns += BEAT_NS
            self.driver.safety = safety(verdict=verdict)
            self.driver.odometry.append(odometry(boot=boot, mono_ns=self.now_ns))
            self.operator.on_beat(self.now_ns)
            if self.now_ns >= end_ns:
                return

    def drives(self) -> bool:
        """Run one control step; return whether a request was sent."""
        (source,) = (p for p in self.bus.publishers if p.topic is keys.DRIVE)
        before = source.last
        self.beat()
        return source.last is not before

    @property
    def asked(self) -> list[Any]:
        """The requests of the calls."""
        return [request for _, request in self.bus.asked]

    def ready(self) -> None:
        """Run the setup steps of the operator, and confirm the pose."""
        self.now_ns += TRY_NS
        self.beat()
        self.bus.answers[-1][0](m.Done(text="the pose is set"))


@pytest.fixture
def fixture() -> DriverFixture:
    return DriverFixture()


def test_the_vehicle_is_put_back_and_its_pose_set_before_it_drives(fixture: DriverFixture) -> None:
    assert not fixture.drives()
    assert fixture.vehicle.done == [Place(x=0.0, y=0.0)]
    assert fixture.asked == [m.PoseRequest(echo=1)]
    assert not fixture.drives()
    fixture.ready()
    assert fixture.drives()


def test_what_cannot_be_set_right_is_tried_again(fixture: DriverFixture) -> None:
    fixture.vehicle.there = False
    fixture.beat(2.0)
    assert fixture.asked == []
    fixture.vehicle.there = True
    fixture.beat(1.0)
    fixture.bus.answers[-1][1]("there is no router")
    fixture.beat(2 * TRY_NS / NS_PER_S)
    assert len(fixture.asked) >= 3
    assert not fixture.drives()


def test_a_new_odometry_gets_the_true_pose_once_the_vehicle_stands(fixture: DriverFixture) -> None:
    fixture.ready()
    assert fixture.drives()
    fixture.bus.asked.clear()
    fixture.vehicle.now = truth(0, x=1.0, y=2.0, heading=7.0, linear=0.1)
    fixture.beat(2.0, boot=6)
    assert fixture.asked == []
    fixture.vehicle.now = truth(0, x=1.0, y=2.0, heading=7.0)
    fixture.beat(1.0, boot=6)
    pose = fixture.asked[0]
    assert (pose.x, pose.y, pose.heading) == pytest.approx((1.0, 2.0, 7.0 - math.tau))
    index = fixture.driver.lap.index
    fixture.bus.answers[-1][0](m.Done(text="the pose is set"))
    fixture.beat(boot=6)
    assert fixture.driver.lap.index >= index, "the lap goes on"


def test_without_odometry_nobody_asks_to_move(fixture: DriverFixture) -> None:
    fixture.ready()
    assert fixture.drives()
    (source,) = (p for p in fixture.bus.publishers if p.topic is keys.DRIVE)
    before = source.last
    fixture.operator.on_beat(fixture.now_ns + OLD_NS + 1)
    assert source.last is before


def test_a_lap_that_gets_nowhere_is_begun_anew(fixture: DriverFixture) -> None:
    fixture.ready()
    fixture.vehicle.done.clear()
    fixture.beat(STEP_S[QUICK] - 1.0, verdict="stop")
    assert fixture.vehicle.done == []
    fixture.beat(2.0, verdict="stop")
    assert fixture.vehicle.done[0] == Place(x=0.0, y=0.0)
    assert fixture.driver.lap.index == 0


def test_after_a_lap_comes_the_next_one(fixture: DriverFixture) -> None:
    fixture.ready()
    first = fixture.driver.lap
    first.index = len(lap(fast=False))
    fixture.beat()
    assert fixture.driver.lap is not first
    assert fixture.drives()


def test_old_poses_are_not_kept(fixture: DriverFixture) -> None:
    fixture.ready()
    fixture.beat(5.0)
    assert len(fixture.driver.odometry) == 1
