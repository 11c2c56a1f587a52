"""The line of a route: places on it, corners, and the certainty across it."""

import math

import pytest

from common.pose import Covariance, Pose
from services.patrol.core.routes import problem
from services.patrol.core.track import Track, across
from services.patrol.core.way import Way
from tests.patrol.core.vehicle_fixture import LINE, LOOP, route

SQUARE = Track([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)])


@pytest.mark.parametrize(
    ("along", "point"),
    [(-1.0, (0, 0)), (0.0, (0, 0)), (1.0, (1, 0)), (4.0, (4, 0)), (6.0, (4, 2)), (8.0, (4, 4)),
     (9.0, (3, 4)), (99.0, (0, 0))],
)  # fmt: skip
def test_a_place_is_a_length(along: float, point: tuple[float, float]) -> None:
    assert SQUARE.point(along) == pytest.approx(point)


@pytest.mark.parametrize(
    ("x", "y", "along", "found", "deviation"),
    [
        (1.0, 0.3, 0.0, 1.0, 0.3),
        (5.0, -1.0, 3.0, 4.0, math.sqrt(2)),
        (0.1, 0.1, 0.0, 0.1, 0.1),
        (0.1, 0.1, 15.0, 15.9, 0.1),  # the other end of the loop
        (2.0, 0.1, 8.0, 6.0, 2.76),  # the window ends between
    ],
)
def test_the_nearest_place_is_within_the_window(
    x: float, y: float, along: float, found: float, deviation: float
) -> None:
    nearest = SQUARE.nearest(x, y, along, 2.0)
    assert nearest.along == pytest.approx(found, abs=0.15)
    assert nearest.deviation == pytest.approx(deviation, abs=0.15)


def test_on_the_way_out_and_back_the_nearer_one_counts() -> None:
    there_and_back = Track([(0.0, 0.0), (3.0, 0.0), (0.0, 0.0)])
    assert there_and_back.nearest(2.0, 0.0, 1.5, 5.0).along == pytest.approx(2.0)
    assert there_and_back.nearest(2.0, 0.0, 4.5, 5.0).along == pytest.approx(4.0)


def test_only_the_uncertainty_across_the_line_counts() -> None:
    long = Covariance(1.0, 0.0, 0.01, 0.0, 0.0, 0.0)
    assert across(long, 0.0) == pytest.approx(0.1)
    assert across(long, math.pi / 2) == pytest.approx(1.0)
    assert across(long, math.pi) == pytest.approx(0.1)


def test_the_margin_is_what_deviation_and_two_sigma_leave() -> None:
    fit = Way(route()).fit(Pose(1.0, 0.2, 0.0), Covariance(9, 0, 0.01, 0, 0, 0), 1.0, 3.0)
    assert fit.margin == pytest.approx(0.5 - 0.2 - 0.2)


def test_it_stops_at_stations_corners_and_the_end() -> None:
    way, home = Way(route(LOOP)), Way(route(LOOP), homeward=True)
    assert [(each.index, each.station) for each in way.stops] == [
        (1, "gate"), (2, ""), (3, ""), (4, ""),
    ]  # fmt: skip
    assert [each.index for each in home.stops] == [1, 2, 3, 4]
    assert (way.is_closed, Way(route(LINE)).is_closed) == (True, False)
    assert home.progress(0.0) == way.progress(14.0) == pytest.approx(14.0)


def test_a_corner_that_was_passed_is_left_out_and_a_station_only_far_behind() -> None:
    way = Way(route(LOOP))
    assert [way.next_stop(1, along) for along in (0.0, 5.0, 7.5, 99.0)] == [1, 1, 2, 3]
    assert [way.next_stop(0, along) for along in (4.9, 5.1, 99.0)] == [0, 1, 3]
    assert way.points_to(0, 99.0, 1.0) == [(4.0, 0.0)]
    assert way.points_to(2, 1.0, 1.0) == [(2.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        (LINE, None),
        (((0.0, 0.0), (4.0, 0.0, "gate")), "route.no_home"),
        (((0.0, 0.0, "home"), (4.0, 0.0, "gate"), (4.0, 1.0, "gate")), "route.station_twice"),
        (((0.0, 0.0, "home"), (60.0, 0.0)), "route.gap"),
        (((0.0, 0.0, "home"), (0.2, 0.0)), "teach.short"),
        (((0.0, 0.0, "home"), (0.5, 0.0), (1.0, 0.5)), None),
    ],
)
def test_a_route_that_cannot_be_driven_is_named(points: object, reason: str | None) -> None:
    found = problem(route(points))  # type: ignore[arg-type]
    assert (found and found.name) == reason
