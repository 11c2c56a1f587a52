"""Ramps of the motors, arcs and obstacles; and each weakness of the motors, with figures."""

import math

import pytest

from common.motion import Twist
from common.wire.commands import MotionKind
from sim.geometry import Pose
from sim.model import Drive
from sim.vehicle import Motors, moved

DT = 0.01
TRACK = 0.56
RUN, STOP, BREAK = MotionKind.RUN, MotionKind.STOP, MotionKind.BREAK


def test_a_quarter_circle_is_exact() -> None:
    pose = moved(Pose(0.0, 0.0, 0.0), Twist(math.pi, math.pi / 2), 1.0)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((2.0, 2.0, math.pi / 2))


class Ride:
    """Motors with the velocity that they reach, and the distance."""

    def __init__(self, **drive: float) -> None:
        self.motors = Motors(Drive(**drive), TRACK)
        self.twist = Twist()
        self.distance = 0.0

    def after(
        self, seconds: float, kind: MotionKind, linear: float = 0.0, angular: float = 0.0
    ) -> Twist:
        for _ in range(round(seconds / DT)):
            self.twist = self.motors.follow(self.twist, kind, Twist(linear, angular), DT)
            self.distance += self.twist.linear * DT
        return self.twist

    def stopping(self, kind: MotionKind) -> float:
        """Return the distance until standstill."""
        before = self.distance
        while self.twist != Twist():
            self.after(DT, kind)
        return self.distance - before


def test_each_command_has_its_ramp_and_the_speed_a_limit() -> None:
    ride = Ride()
    ramp = ride.after(0.2, RUN, 30.0, -50.0)
    assert (ramp.linear, ramp.angular) == pytest.approx((0.24, -0.6))
    assert ride.after(2.0, RUN, 30.0, -50.0) == Twist(1.5, -1.5)
    ramp = ride.after(0.5, STOP)
    assert (ramp.linear, ramp.angular) == pytest.approx((1.1, -0.5))
    assert ride.after(DT, BREAK, 1.0, -1.0) == Twist()  # whatever velocity comes with it


def test_nothing_happens_within_the_dead_time_not_even_brake() -> None:
    ride = Ride(dead_time=0.15)
    assert ride.after(0.15, RUN, 0.5) == Twist()
    assert ride.after(DT, RUN, 0.5).linear > 0
    ride.after(2.0, RUN, 0.5)
    assert ride.after(0.15, BREAK).linear == 0.5
    assert ride.after(DT, BREAK) == Twist()


@pytest.mark.parametrize(
    ("drive", "speed", "kind", "distance"),
    [
        # At 0.8 m/s^2 down to 0.24 m/s, and from there by the time constant.
        ({"lag": 0.3}, 0.5, STOP, (0.5**2 - 0.24**2) / (2 * 0.8) + 0.24 * 0.3),
        ({"brake": 2.0}, 0.8, BREAK, 0.8**2 / (2 * 2.0)),
    ],
)
def test_the_distance_of_a_stop(
    drive: dict[str, float], speed: float, kind: MotionKind, distance: float
) -> None:
    ride = Ride(**drive)
    assert ride.after(4.0, RUN, speed) == Twist(speed)
    assert ride.stopping(kind) == pytest.approx(distance, abs=0.01)


def test_slower_than_the_dead_zone_stands_still() -> None:
    ride = Ride(dead_zone=0.06)
    assert ride.after(1.0, RUN, 0.05) == Twist()
    assert ride.after(1.0, RUN, 0.0, 0.2) == Twist()  # 0.056 m/s of each side
    assert ride.after(1.0, RUN, 0.1) == Twist(0.1)
    # The inner side stands: 0.1 - 0.056 is in the dead zone.
    twist = ride.after(1.0, RUN, 0.1, 0.2)
    assert (twist.linear, twist.angular) == pytest.approx((0.078, 0.156 / TRACK))


@pytest.mark.parametrize(
    ("drive", "linear", "angular"),
    [
        ({"asymmetry": 0.04}, 0.5, 0.5 * 0.04 / TRACK),
        ({"weak_wheel": 0.3}, 0.5 * (1 - 0.3 / 4), 0.5 * 0.15 / TRACK),  # a left one
    ],
)
def test_unlike_wheels_curve_a_straight_line(
    drive: dict[str, float], linear: float, angular: float
) -> None:
    twist = Ride(**drive).after(3.0, RUN, 0.5)
    assert (twist.linear, twist.angular) == pytest.approx((linear, angular))


def test_on_a_slope_stop_ramps_down_and_then_lets_roll() -> None:
    ride = Ride(slope=math.radians(2))
    assert ride.after(1.0, RUN) == Twist()  # the speed loop holds
    ride.after(1.0, RUN, 0.4)
    assert ride.after(0.5, STOP).linear == pytest.approx(0.0, abs=0.02)
    assert ride.after(1.0, STOP).linear == pytest.approx(0.342, abs=0.02)  # g sin 2 degrees
    assert ride.after(DT, BREAK) == Twist()
    assert ride.after(1.0, BREAK) == Twist()
    assert ride.after(1.0, STOP).linear == pytest.approx(0.342, abs=0.02)
    assert Ride(slope=-0.2).after(5.0, STOP) == Twist(-1.5)  # it rises ahead
