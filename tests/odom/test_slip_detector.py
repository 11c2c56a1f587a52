"""Counters against velocities over the last second."""

import pytest

from common.freshness import NS_PER_S
from services.odom.config import Odom
from services.odom.pose import ArcSegment
from services.odom.slip_detector import SlipDetector

TICK_NS = NS_PER_S // 50


def way(
    distance: float, turn: float = 0.0, time_s: float = 0.02, *, seen: bool = True
) -> ArcSegment:
    return ArcSegment(distance, turn, time_s, seen)


def compared(ticks: int, counted: ArcSegment, integrated: ArcSegment) -> tuple[SlipDetector, int]:
    """Return a detector of so many samples and the time of the last one."""
    detector = SlipDetector(Odom(slip_distance=0.1, slip_turn=0.2))
    for tick in range(1, ticks + 1):
        detector.add(tick * TICK_NS, counted, integrated)
    detector.update(ticks * TICK_NS)
    return detector, ticks * TICK_NS


def test_nothing_to_compare_is_unknown() -> None:
    detector = SlipDetector(Odom())
    detector.update(0)
    assert detector.residual is None
    assert not detector.slip


def test_the_residual_is_what_the_counters_went_farther() -> None:
    detector, _ = compared(10, way(0.02), way(0.015))
    assert detector.residual == pytest.approx(0.05)
    assert not detector.slip


def test_only_the_last_second_counts() -> None:
    detector, now_ns = compared(500, way(0.02), way(0.019))
    assert detector.residual == pytest.approx(0.051)
    detector.update(now_ns + 2 * NS_PER_S)
    assert detector.residual is None


def test_what_no_velocity_saw_is_not_compared() -> None:
    detector, _ = compared(10, way(0.02), way(0.0, seen=False))
    assert detector.residual is None
    assert not detector.slip


def test_the_way_after_a_gap_is_not_compared() -> None:
    """After a stall of the counters, the next sample covers the gap."""
    detector = SlipDetector(Odom())
    detector.add(1 * TICK_NS, way(0.0), way(0.0, seen=False))
    detector.add(2 * TICK_NS, way(0.5), way(0.01))
    detector.add(3 * TICK_NS, way(0.02), way(0.01))
    detector.update(3 * TICK_NS)
    assert detector.residual == pytest.approx(0.01)
    assert not detector.slip


@pytest.mark.parametrize("sign", [1, -1])
def test_slip_by_distance_or_by_turn(sign: int) -> None:
    assert compared(10, way(sign * 0.011), way(0.0))[0].slip
    assert not compared(10, way(sign * 0.009), way(0.0))[0].slip
    assert compared(10, way(0.0, sign * 0.021), way(0.0))[0].slip
    assert not compared(10, way(0.0, sign * 0.019), way(0.0))[0].slip


def test_slip_falls_under_half_of_its_limit_only() -> None:
    detector, now_ns = compared(11, way(0.01), way(0.0))
    slips = [detector.slip]
    for samples_left in (7, 4):  # 0.07 m, 0.04 m
        detector.update(now_ns + NS_PER_S - (samples_left - 1) * TICK_NS)
        slips.append(detector.slip)
    assert slips == [True, True, False]
    assert detector.residual == pytest.approx(0.04)


def test_the_counters_make_a_twist_of_the_last_fifth_of_a_second() -> None:
    detector, now_ns = compared(50, way(0.01, -0.02), way(0.0))
    twist = detector.twist(now_ns)
    assert twist is not None
    assert (twist.linear, twist.angular) == pytest.approx((0.5, -1.0))
    assert twist.linear_variance == pytest.approx((0.001 / 0.22) ** 2)


def test_too_short_a_time_makes_no_twist() -> None:
    detector, now_ns = compared(2, way(0.01), way(0.0))
    assert detector.twist(now_ns) is None


def test_it_starts_anew() -> None:
    detector, now_ns = compared(10, way(0.02), way(0.0))
    detector.clear()
    detector.update(now_ns)
    assert detector.residual is None
    assert detector.twist(now_ns) is None
    assert not detector.slip
