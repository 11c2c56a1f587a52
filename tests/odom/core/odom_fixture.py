"""A board that drives a known path, and an estimator that receives part of its samples."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.pose import Pose
from services.odom.config import Odom
from services.odom.core.estimator import Estimator
from t2.messages import Mileage, Odometry, Velocity

TICK_NS = NS_PER_S // 50
EXACT = pytest.approx((0.0, 0.0), abs=1e-6)

speeds = st.floats(-1.5, 1.5)
turnings = st.floats(-1.5, 1.5)
losses = st.lists(st.tuples(st.booleans(), st.booleans()), max_size=40)
parts = st.lists(st.tuples(speeds, turnings, losses), max_size=5)


@dataclass
class Board:
    """A simulated board: drives exact arcs, and reports counters and velocities."""

    distance: float = 0.0
    heading: float = 0.0
    linear: float = 0.0
    angular: float = 0.0
    epoch: int = 0
    boot: int = 1
    coarse: bool = False  # count in steps of 1 mm and 0.1 deg
    now_ns: int = NS_PER_S

    def __post_init__(self) -> None:
        self.truth = Pose(0.0, 0.0, 0.0)

    def tick(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.now_ns += TICK_NS
            distance, turn = self.linear * TICK_NS / NS_PER_S, self.angular * TICK_NS / NS_PER_S
            self.distance += distance
            self.heading += turn
            self.truth = self.truth.moved(distance, turn)

    def mileage(self) -> Mileage:
        distance, heading = self.distance, math.remainder(self.heading, math.tau)
        if self.coarse:
            distance = round(distance, 3)
            heading = math.radians(round(math.degrees(heading), 1))
        return Mileage(distance=distance, heading=heading, epoch=self.epoch, boot=self.boot)

    def velocity(self) -> Velocity:
        return Velocity(linear=self.linear, angular=self.angular)


class OdomFixture:
    """An estimator beside a board."""

    def __init__(self, board: Board, settings: Odom | None = None) -> None:
        self.board = board
        self.estimator = Estimator(settings or Odom())

    def update(self, *, counters: bool = True, velocity: bool = True) -> bool:
        """Take the samples of the board in the order in which the bridge publishes them."""
        restarted = counters and self.estimator.on_mileage(self.board.mileage(), self.board.now_ns)
        if velocity:
            self.estimator.on_velocity(self.board.velocity(), self.board.now_ns)
        return restarted

    def drive(self, ticks: int, *, counters: bool = True, velocity: bool = True) -> None:
        for _ in range(ticks):
            self.board.tick()
            self.update(counters=counters, velocity=velocity)

    def odometry(self, after_ns: int = 0) -> Odometry:
        odometry = self.estimator.estimate(self.board.now_ns + after_ns)
        assert odometry is not None
        return odometry

    def pose(self) -> Pose:
        odometry = self.odometry()
        return Pose(odometry.x, odometry.y, odometry.heading)

    def off(self) -> tuple[float, float]:
        """Return how far (m, rad) the estimate is from the truth."""
        return apart(self.pose(), self.board.truth)


def apart(a: Pose, b: Pose) -> tuple[float, float]:
    """Return the distance and the angle between two poses."""
    turned = abs(math.remainder(a.heading - b.heading, math.tau))
    return math.hypot(a.x - b.x, a.y - b.y), turned


def started(**board: float) -> OdomFixture:
    """Return an estimator after its first samples."""
    odom = OdomFixture(Board(**board))  # type: ignore[arg-type]
    odom.update()
    return odom


def driving() -> OdomFixture:
    """Return an estimator beside a board that has driven a while."""
    odom = started(distance=70.0, heading=2.0)
    odom.board.linear, odom.board.angular = 0.8, 0.3
    odom.drive(100)
    return odom
