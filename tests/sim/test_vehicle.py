import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.motion import Twist
from common.settings import Vehicle
from common.wire.commands import MotionKind
from sim.config import Drive
from sim.geometry import Pose
from sim.vehicle import move, moved, next_twist, wheel_angles

DRIVE = Drive()
DT = 0.01
AT_SPEED = Twist(1.0, -1.0)
STANDING = Twist()
twists = st.builds(Twist, st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))


def settled(twist: Twist, kind: MotionKind, target: Twist = STANDING) -> tuple[Twist, float]:
    """Return where the velocity comes to, and after how many seconds."""
    steps = 0
    while (following := next_twist(twist, kind, target, DRIVE, DT)) != twist:
        twist, steps = following, steps + 1
    return twist, steps * DT


def test_break_stops_at_once() -> None:
    assert next_twist(AT_SPEED, MotionKind.BREAK, AT_SPEED, DRIVE, DT) == Twist()


def test_stop_ramps_down_whatever_velocity_comes_with_it() -> None:
    end, seconds = settled(AT_SPEED, MotionKind.STOP, AT_SPEED)
    assert end == Twist()
    assert seconds == pytest.approx(1.0 / DRIVE.coast, abs=DT)


def test_run_follows_by_its_speed_loop_and_stays() -> None:
    target = Twist(0.6, 0.3)
    end, seconds = settled(Twist(), MotionKind.RUN, target)
    assert end == target
    assert seconds == pytest.approx(0.6 / DRIVE.acceleration, abs=DT)


def test_run_at_zero_is_regulated_to_zero() -> None:
    end, seconds = settled(Twist(-0.6), MotionKind.RUN)
    assert end == Twist()
    assert seconds == pytest.approx(0.6 / DRIVE.acceleration, abs=DT)


def test_the_motors_have_a_greatest_speed() -> None:
    end, _ = settled(Twist(), MotionKind.RUN, Twist(30.0, -50.0))
    assert end == Twist(DRIVE.max_linear, -DRIVE.max_angular)


def test_a_straight_way() -> None:
    pose = moved(Pose(1.0, 1.0, math.pi / 2), Twist(2.0), 0.5)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((1.0, 2.0, math.pi / 2))


def test_a_quarter_circle_in_one_step_is_exact() -> None:
    pose = moved(Pose(0.0, 0.0, 0.0), Twist(math.pi, math.pi / 2), 1.0)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((2.0, 2.0, math.pi / 2))


@given(twists, st.integers(1, 50))
def test_many_short_steps_are_one_long_one(twist: Twist, steps: int) -> None:
    pose = Pose(0.0, 0.0, 0.3)
    for _ in range(steps):
        pose = moved(pose, twist, 1.0 / steps)
    once = moved(Pose(0.0, 0.0, 0.3), twist, 1.0)
    assert (pose.x, pose.y) == pytest.approx((once.x, once.y), abs=1e-6)


def test_a_free_way_is_gone_whole() -> None:
    way = move(Pose(0.0, 0.0, 0.0), Twist(1.0, 0.5), 0.1, lambda _: False)
    assert not way.held
    assert (way.distance, way.turn) == pytest.approx((0.1, 0.05))


def test_a_way_ends_just_before_what_blocks_it() -> None:
    way = move(Pose(0.0, 0.0, 0.0), Twist(1.0), 0.1, lambda pose: pose.x > 0.03)
    assert way.held
    assert 0.0299 < way.pose.x <= 0.03
    assert way.distance == pytest.approx(way.pose.x)


def test_a_way_that_is_blocked_at_once_stays() -> None:
    start = Pose(1.0, 2.0, 3.0)
    way = move(start, Twist(1.0, 1.0), 0.1, lambda pose: pose != start)
    assert way.held
    assert (way.pose, way.distance, way.turn) == (start, 0.0, 0.0)


def test_wheels_are_straight_on_a_straight_way() -> None:
    assert set(wheel_angles(Twist(0.5), Vehicle())) == {0.0}


def test_wheels_stand_across_the_radius_when_turning_on_the_spot() -> None:
    vehicle = Vehicle(wheelbase=0.6, track=0.6)
    quarter = math.pi / 4
    angles = wheel_angles(Twist(0.0, 1.0), vehicle)
    assert angles == pytest.approx((-quarter, quarter, quarter, -quarter))


@given(twists)
def test_every_wheel_rolls_the_way_its_place_moves(twist: Twist) -> None:
    vehicle = Vehicle()
    x, y = vehicle.wheelbase / 2, vehicle.track / 2
    places = ((x, y), (x, -y), (-x, y), (-x, -y))
    for angle, (px, py) in zip(wheel_angles(twist, vehicle), places, strict=True):
        assert abs(angle) <= math.pi / 2
        forward, left = twist.linear - twist.angular * py, twist.angular * px
        speed = forward * math.cos(angle) + left * math.sin(angle)
        rolling = speed * math.cos(angle), speed * math.sin(angle)
        assert rolling == pytest.approx((forward, left), abs=1e-9)
