"""Segments: the counters' length and turn, the velocities' shape."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.odom.pose import ArcSegment, fitted, halved, total

segments = st.builds(
    ArcSegment, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.001, 0.2), st.booleans()
)
ways = st.lists(segments, max_size=8)


@given(ways, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_fitted_legs_come_to_what_was_counted(
    way: list[ArcSegment], distance: float, turn: float
) -> None:
    sum_ = total(fitted(way, distance, turn))
    assert (sum_.distance, sum_.turn) == pytest.approx((distance, turn), abs=1e-9)
    assert sum_.time_s == pytest.approx(total(way).time_s)


def test_no_legs_are_one_arc() -> None:
    assert fitted([], 1.0, 0.5) == [ArcSegment(1.0, 0.5, 0.0, seen=True)]


def test_what_nobody_saw_takes_the_difference() -> None:
    way = [ArcSegment(1.0, 0.0, 1.0, seen=True), ArcSegment(0.0, 0.0, 1.0, seen=False)]
    assert fitted(way, 3.0, 0.5) == [way[0], ArcSegment(2.0, 0.5, 1.0, seen=False)]


def test_the_difference_is_spread_by_time_when_all_was_seen() -> None:
    way = [ArcSegment(1.0, 0.0, 1.0, seen=True), ArcSegment(1.0, 0.0, 3.0, seen=True)]
    first, second = fitted(way, 2.4, -0.4)
    assert (first.distance, first.turn) == pytest.approx((1.1, -0.1))
    assert (second.distance, second.turn) == pytest.approx((1.3, -0.3))


@given(ways)
def test_halving_keeps_the_way(way: list[ArcSegment]) -> None:
    half = halved(way)
    assert len(half) == (len(way) + 1) // 2
    assert total(half).distance == pytest.approx(total(way).distance, abs=1e-9)
    assert total(half).turn == pytest.approx(total(way).turn, abs=1e-9)
    assert total(half).seen == total(way).seen
