"""The line of a route: places on it, corners, and the certainty across it."""

import math
from collections.abc import Sequence
from typing import Any

import pytest

from common.pose import Covariance, Pose
from services.patrol.core.routes import length, problem, stations
from services.patrol.core.track import Track, across
from services.patrol.core.way import Stop, Way
from t2.messages import Phrase
from t2.motion import FACING
from tests.patrol.core.vehicle_fixture import LINE, LOOP, route

SQUARE = Track([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)])


@pytest.mark.parametrize(
    ("along", "point"),
    [(-1.0, (0, 0)), (0.0, (0, 0)), (1.0, (1, 0)), (4.0, (4, 0)), (6.0, (4, 2)), (8.0, (4, 4)),
     (9.0, (3, 4)), (99.0, (0, 0))],
)  # fmt: skip
def test_a_place_is_a_length(along: float, point: tuple[float, float]) -> None:
    assert SQUARE.point(along) == pytest.approx(point)


def test_a_point_twice_at_an_end_is_one_place() -> None:
    track = Track([(0.0, 0.0), (0.0, 0.0), (3.0, 0.0), (3.0, 0.0)])
    assert [track.point(along) for along in (-1.0, 9.0)] == [(0.0, 0.0), (3.0, 0.0)]


@pytest.mark.parametrize(
    ("x", "y", "along", "found", "deviation"),
    [
        (1.0, 0.3, 0.0, 1.0, 0.3),
        (5.0, -1.0, 3.0, 4.0, math.sqrt(2)),
        (0.1, 0.1, 0.0, 0.1, 0.1),
        (0.1, 0.1, 15.0, 15.9, 0.1),  # the other end of the loop
        (2.0, 0.1, 8.0, 6.0, math.hypot(2.0, 1.9)),  # the window begins between
        (4.0, 4.0, 2.5, 4.5, 3.5),  # the window ends between
    ],
)
def test_the_nearest_place_is_within_the_window(
    x: float, y: float, along: float, found: float, deviation: float
) -> None:
    nearest = SQUARE.nearest(x, y, along, 2.0)
    assert (nearest.along, nearest.deviation) == pytest.approx((found, deviation))


@pytest.mark.parametrize(
    ("along", "direction"), [(2.0, 0.0), (6.0, 0.5), (10.0, 1.0), (14.0, -0.5)]
)
def test_the_direction_is_that_of_the_line(along: float, direction: float) -> None:
    nearest = SQUARE.nearest(*SQUARE.point(along), along, 1.0)
    assert nearest.direction == pytest.approx(direction * math.pi)


def test_on_the_way_out_and_back_the_nearer_one_counts() -> None:
    there_and_back = Track([(0.0, 0.0), (3.0, 0.0), (0.0, 0.0)])
    assert there_and_back.nearest(2.0, 0.0, 1.5, 5.0).along == pytest.approx(2.0)
    assert there_and_back.nearest(2.0, 0.0, 4.5, 5.0).along == pytest.approx(4.0)


def test_only_the_uncertainty_across_the_line_counts() -> None:
    long = Covariance(1.0, 0.0, 0.01, 0.0, 0.0, 0.0)
    assert across(long, 0.0) == pytest.approx(0.1)
    assert across(long, math.pi / 2) == pytest.approx(1.0)
    assert across(long, math.pi) == pytest.approx(0.1)
    diagonal = Covariance(0.5, 0.49, 0.5, 0.0, 0.0, 0.0)
    assert across(diagonal, math.pi / 4) == pytest.approx(0.1)


def test_the_margin_is_what_deviation_and_two_sigma_leave() -> None:
    fit = Way(route()).fit(Pose(1.0, 0.2, 0.0), Covariance(9, 0, 0.01, 0, 0, 0), 1.0, 3.0)
    assert fit.margin == pytest.approx(0.5 - 0.2 - 0.2)


def test_it_stops_at_stations_corners_and_the_end() -> None:
    way, home = Way(route(LOOP)), Way(route(LOOP), homeward=True)
    assert [(each.index, each.station) for each in way.stops] == [
        (1, "gate"), (2, ""), (3, ""), (4, ""),
    ]  # fmt: skip
    assert [each.index for each in home.stops] == [1, 2, 3, 4]
    assert home.progress(5.0) == way.progress(9.0) == pytest.approx(9.0)


def test_on_the_way_home_it_stops_only_where_it_turns() -> None:
    there = route(
        ((0.0, 0.0, "home"), (2.0, 0.0, "gate"), (3.0, 0.0), (4.0, 0.0, "end"), (4.0, 3.0)),
        stay=5.0,
    )
    assert Way(there).stops == [Stop(1, "gate", 5.0), Stop(3, "end", 5.0), Stop(4)]
    assert Way(there, homeward=True).stops == [Stop(1), Stop(4)]


@pytest.mark.parametrize(
    ("points", "corners"),
    [
        (((0.0, 0.0), (0.0, 1.0), (0.0, 2.0)), []),
        (((0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (1.0, 1.0)), [2]),  # a point twice
        (((0.0, 1.0), (0.0, 0.0), (1.0, 0.0)), [1]),
        (((-1.0, 0.0), (0.0, 0.0), (math.cos(FACING), math.sin(FACING))), []),
        (((-1.0, 0.0), (0.0, 0.0), (math.cos(0.81), math.sin(0.81))), [1]),
    ],
)
def test_a_corner_is_where_the_vehicle_turns_on_the_spot(
    points: Sequence[Any], corners: list[int]
) -> None:
    stops = Way(route(points)).stops
    assert [each.index for each in stops] == [*corners, len(points) - 1]


@pytest.mark.parametrize(("gap", "is_closed"), [(0.0, True), (0.1, True), (0.11, False)])
def test_a_route_is_closed_that_ends_within_ten_centimetres_of_home(
    gap: float, is_closed: bool
) -> None:
    way = Way(route(((0.0, 0.0, "home"), (4.0, 0.0), (gap, 0.0))))
    assert way.is_closed == is_closed


def test_a_corner_that_was_passed_is_left_out_and_a_station_only_far_behind() -> None:
    way = Way(route(LOOP))
    assert [way.next_stop(1, along) for along in (0.0, 5.0, 7.0, 99.0)] == [1, 1, 2, 3]
    assert [way.next_stop(0, along) for along in (4.9, 5.0, 99.0)] == [0, 1, 3]


@pytest.mark.parametrize(
    ("stop", "along", "points"),
    [
        (2, 1.0, [(2.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]),
        (2, 3.0, [(4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]),  # ends at a point: once
        (0, 3.0, [(4.0, 0.0)]),
        (0, 99.0, [(4.0, 0.0)]),
    ],
)
def test_the_points_to_a_stop_begin_ahead(
    stop: int, along: float, points: list[tuple[float, float]]
) -> None:
    assert Way(route(LOOP)).points_to(stop, along, 1.0) == points


def test_two_stations_at_one_place_are_one_point_of_the_way() -> None:
    way = Way(route(((0.0, 0.0, "home"), (2.0, 0.0, "door"), (2.0, 0.0, "window"), (5.0, 0.0))))
    assert way.points_to(1, 0.0, 1.0) == [(1.0, 0.0), (2.0, 0.0)]


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        (LINE, None),
        (((0.0, 0.0, "home"), (0.5, 0.0), (1.0, 0.5)), None),
        (((0.0, 0.0, "home"), (50.0, 0.0)), None),
        (((0.0, 0.0, "home"), (0.5, 0.0)), None),
        (((0.0, 0.0), (4.0, 0.0, "gate")), Phrase("route.no_home")),
        (
            ((0.0, 0.0, "home"), (4.0, 0.0, "gate"), (4.0, 1.0, "gate")),
            Phrase("route.station_twice", {"station": "gate", "first": 2, "second": 3}),
        ),
        (
            ((0.0, 0.0, "home"), (1.0, 0.0), (61.0, 0.0)),
            Phrase("route.gap", {"first": 2, "second": 3, "distance": 60.0, "most": 50.0}),
        ),
        (
            ((0.0, 0.0, "home"), (0.25, 0.0)),
            Phrase("teach.short", {"length": 0.25, "least": 0.5}),
        ),
    ],
)
def test_why_a_route_cannot_be_driven(points: Sequence[Any], reason: Phrase | None) -> None:
    assert problem(route(points)) == reason


def test_a_route_has_a_length_and_stations() -> None:
    assert (length(route(LOOP)), stations(route(LOOP))) == (14.0, ("home", "gate"))
