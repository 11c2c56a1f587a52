"""Teaching: what is recorded of a drive, and what ends the recording."""

import math
from itertools import pairwise
from typing import Any

import msgspec
import pytest

from common.pose import Pose
from services.patrol.core.routes import LEAST, length, problem
from services.patrol.core.teaching import Refused, Teaching, _close, _is_straight
from t2 import messages as m
from t2.messages import Phrase
from tests.factories import map_pose
from tests.patrol.core.vehicle_fixture import route

HOME = (0.0, 0.0)
STEP = 0.02  # m of one pose
WEST = tuple((-0.2 * step, math.pi) for step in range(1, 5))  # x, heading


def pose_at(at: Pose, sigma: float = 0.05, **fields: Any) -> m.MapPose:
    variance = sigma**2
    covariance = (variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance)
    return map_pose(x=at.x, y=at.y, heading=at.heading, pose_covariance=covariance, **fields)


class Lesson:
    """A drive that is taught."""

    def __init__(self) -> None:
        self.at = Pose(0.0, 0.0, 0.0)
        self.teaching = Teaching("yard", "001", "home", 0.0, pose_at(self.at))

    def forward(self, distance: float, radius: float = math.inf, step: float = STEP) -> "Lesson":
        """Drive, m; negative is backward."""
        count, step = round(abs(distance) / step), math.copysign(step, distance)
        for _ in range(count):
            self.at = self.at.moved(step, step / radius)
            self.teaching.on_pose(pose_at(self.at))
        return self

    def turn(self, angle: float) -> "Lesson":
        """Turn on the spot, rad."""
        for _ in range(20):
            self.at = self.at.moved(0.0, angle / 20)
            self.teaching.on_pose(pose_at(self.at))
        return self

    @property
    def reason(self) -> str | None:
        """Why nothing more is recorded."""
        return self.teaching.reason.name if self.teaching.reason else None

    @property
    def corners(self) -> list[tuple[float, float]]:
        """The points of the route."""
        return [(each.x, each.y) for each in self.teaching.route(0.5).points]


def taught(*places: float | tuple[float, float, float], of: Teaching | None = None) -> Teaching:
    """Teach exactly these places, x or x, y and heading."""
    teaching = of or Lesson().teaching
    for each in places:
        x, y, heading = each if isinstance(each, tuple) else (each, 0.0, 0.0)
        teaching.on_pose(pose_at(Pose(x, y, heading)))
    return teaching


def near(points: list[tuple[float, float]], within: float = 0.06) -> Any:
    return [pytest.approx(each, abs=within) for each in points]


def test_straight_lines_become_their_ends() -> None:
    lesson = Lesson().forward(5.0).turn(math.pi / 2).forward(3.0)
    assert lesson.corners == near([(0.0, 0.0), (5.0, 0.0), (5.0, 3.0)])


def test_a_loop_ends_exactly_at_home() -> None:
    lesson = Lesson()
    for _ in range(4):
        lesson.forward(3.0).turn(math.pi / 2)
    lesson.forward(0.1)
    assert lesson.corners[0] == lesson.corners[-1] == (0.0, 0.0)
    assert length(lesson.teaching.route(0.5)) == pytest.approx(12.0, abs=0.1)


@pytest.mark.parametrize(
    ("driven", "end"),
    [
        ([(0.0, 5.0), (0.0, 0.51)], [(0.0, 5.0), (0.0, 0.51)]),  # it does not end at home
        ([(0.0, 5.0), (0.0, 0.5)], [(0.0, 5.0), (0.0, 0.5), HOME]),
        ([(0.0, 5.0), (0.0, 0.31)], [(0.0, 5.0), (0.0, 0.31), HOME]),
        ([(0.0, 5.0), (0.0, 0.3)], [(0.0, 5.0), HOME]),  # too near: home itself ends it
        ([(5.0, 0.0), (0.2, 0.0)], [(5.0, 0.0), HOME]),
        ([(5.0, 5.0), (0.2, 0.2), (0.1, -0.1)], [(5.0, 5.0), HOME]),
        ([(0.0, 5.0, "gate"), (0.0, 0.2)], [(0.0, 5.0), HOME]),
        ([(0.0, 5.0), (0.0, 0.2, "gate")], [(0.0, 5.0), (0.0, 0.2), HOME]),  # a station stays
    ],
)
@pytest.mark.parametrize("first", ["", "door"])  # a station of the points before
def test_where_a_loop_ends(driven: list[Any], end: list[tuple[float, float]], first: str) -> None:
    begin = [(*HOME, "home"), (5.0, 0.0, first)]
    points = list(route([*begin, *driven]).points)
    _close(points)
    assert [(each.x, each.y) for each in points[2:]] == end


def test_a_curve_is_followed_to_three_centimetres() -> None:
    lesson = Lesson().forward(2 * math.pi, radius=2.0)
    points = lesson.corners
    assert 5 < len(points) < 20
    for (ax, ay), (bx, by) in pairwise(points):
        middle = (ax + bx) / 2, (ay + by) / 2
        assert abs(math.dist(middle, (0.0, 2.0)) - 2.0) < 0.05


@pytest.mark.no_cover
def test_four_kilometres_straight_on_are_a_few_hundred_points() -> None:
    lesson = Lesson().forward(4000.0, step=0.2)
    assert lesson.reason is None
    assert 350 < len(lesson.corners) < 500
    assert length(lesson.teaching.route(0.5)) == pytest.approx(4000.0, rel=1e-3)


def test_a_route_is_full_at_the_limit_of_its_type(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.patrol.core.teaching.MAX_POINTS", 20)
    lesson = Lesson().forward(100.0, radius=1.0)
    assert lesson.teaching.reason == Phrase("teach.full", {"points": 20})
    assert len(lesson.teaching.route(0.5).points) == 19  # a station or home would fit


def test_stations_are_exact_points_in_their_order() -> None:
    lesson = Lesson().forward(1.03)
    lesson.teaching.station("北门", 10.0)
    lesson.teaching.station("gate", 0.0)
    route = lesson.forward(2.0).teaching.route(0.5)
    assert [(each.station, each.x, each.stay) for each in route.points if each.station] == [
        ("home", 0.0, 0.0),
        ("北门", pytest.approx(1.04), 10.0),
        ("gate", pytest.approx(1.04), 0.0),
    ]
    assert problem(route) is None
    written = msgspec.json.encode(route)
    msgspec.json.decode(written, type=m.Route)  # with its limits
    assert written.count(b'"stay"') == len(lesson.teaching.stations)  # no default is written


def test_a_station_has_one_place() -> None:
    lesson = Lesson().forward(1.0)
    with pytest.raises(Refused) as refused:
        lesson.teaching.station("home", 0.0)
    assert refused.value.reason == Phrase("teach.station_twice", {"station": "home"})


def test_small_motions_backward_are_no_part_of_the_route() -> None:
    lesson = Lesson().forward(2.0).forward(-0.15).forward(1.0)
    assert lesson.corners == near([(0.0, 0.0), (2.85, 0.0)])


def test_a_station_may_be_marked_a_bit_backward() -> None:
    lesson = Lesson().forward(2.0).forward(-0.15)
    lesson.teaching.station("gate", 0.0)
    assert lesson.teaching.summary[0] == pytest.approx(lesson.at.x)
    assert lesson.forward(1.0).corners == near([(0.0, 0.0), (1.85, 0.0), (2.85, 0.0)])
    assert lesson.teaching.summary[0] == pytest.approx(2.85, abs=0.06)


@pytest.mark.parametrize("radius", [math.inf, 1.0])
def test_the_end_of_a_route_may_be_a_bit_backward(radius: float) -> None:
    lesson = Lesson().forward(2.0, radius)
    lesson.forward(-0.1, radius)
    assert lesson.corners[-1] == pytest.approx((lesson.at.x, lesson.at.y), abs=1e-3)
    assert lesson.teaching.summary[0] == pytest.approx(1.9, abs=0.02)
    assert len(set(lesson.corners)) == len(lesson.corners)


def test_driving_backward_ends_the_recording_and_keeps_the_part_before() -> None:
    lesson = Lesson().forward(2.0).forward(-0.5).forward(3.0)
    assert lesson.reason == "teach.backward"
    assert [each.name for each in lesson.teaching.phrases] == ["teach.backward", "teach.ends_here"]
    assert lesson.corners == near([(0.0, 0.0), (2.0, 0.0)], within=0.11)
    with pytest.raises(Refused, match="backward"):
        lesson.teaching.station("gate", 0.0)


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (map_pose("lost"), "teach.lost"),
        (map_pose("unplaced"), "teach.lost"),
        (pose_at(Pose(2.0, 0.0, 0.0), sigma=0.3), "teach.uncertain"),
        (pose_at(Pose(2.0, 0.4, 0.0)), "teach.jump"),
        (pose_at(Pose(2.0, 0.0, 0.0), placement=2), "teach.jump"),
        (pose_at(Pose(2.0, 0.0, 0.0), boot=9), "teach.jump"),
    ],
)
def test_an_unknown_position_ends_the_recording(pose: m.MapPose, reason: str) -> None:
    lesson = Lesson().forward(2.0)
    lesson.teaching.on_pose(pose)
    lesson.forward(3.0)
    assert lesson.reason == reason
    assert lesson.corners == near([(0.0, 0.0), (2.0, 0.0)])


def test_the_reason_has_its_numbers() -> None:
    jump: Any = {"distance": pytest.approx(0.5)}
    jumped = taught(0.25, (0.55, 0.4, 0.0))
    assert jumped.phrases == (
        Phrase("teach.jump", jump),
        Phrase("teach.ends_here", {"length": 0.25}),
    )
    uncertain: Any = {"sigma": pytest.approx(0.26), "corridor": 0.5}
    with pytest.raises(Refused) as refused:
        Teaching("yard", "001", "home", 0.0, pose_at(Pose(0.0, 0.0, 0.0), sigma=0.26))
    assert refused.value.reason == Phrase("teach.uncertain", uncertain)


def test_a_pose_may_be_as_far_and_as_uncertain_as_the_limits() -> None:
    teaching = taught(0.3)
    teaching.on_pose(pose_at(Pose(0.3, 0.0, 0.0), sigma=0.25))
    assert teaching.reason is None


@pytest.mark.parametrize(
    ("place", "length"),
    [
        ((0.1, 0.0, 0.0), 0.1),
        ((0.099, 0.0, 0.0), 0.0),
        ((0.05, 0.0, 0.31), 0.05),
        ((0.05, 0.0, -0.31), 0.05),
        ((0.05, 0.0, 0.3), 0.0),  # it has hardly turned
        ((0.011, 0.0, 1.0), 0.011),
        ((0.01, 0.0, 1.0), 0.0),  # it turns on the spot
    ],
)
def test_when_a_pose_is_recorded(place: tuple[float, float, float], length: float) -> None:
    assert taught(place).summary == (length, 2 if length else 1)


def test_a_straight_line_has_a_point_at_ten_metres() -> None:
    teaching = taught(*(0.25 * step for step in range(1, 49)))
    assert [each.x for each in teaching.route(0.5).points] == [0.0, 10.0, 12.0]


@pytest.mark.parametrize(
    ("line", "is_straight"),
    [
        ([HOME, (0.5, 0.03), (1.0, 0.0)], True),
        ([HOME, (0.03, 0.5), (0.0, 1.0)], True),
        ([HOME, (0.5, -0.031), (1.0, 0.0)], False),
        ([HOME, (0.5, 0.0), (0.6, 0.04), (1.0, 0.0)], False),
        ([(2.0, 1.0), (2.5, 1.52), (3.0, 2.0)], True),
        ([(2.0, 1.0), (2.5, 1.55), (3.0, 2.0)], False),
        ([HOME, (0.25, 0.0), (0.25, 0.0), (1.0, 0.0), (1.0, 0.0)], True),
        ([HOME, (0.5, 0.0), (0.25, 0.0), (1.0, 0.0)], False),  # it turned back
        ([(2.0, 1.0), (1.75, 1.0), (3.0, 1.0)], False),
        ([(2.0, 1.0), (3.25, 1.0), (3.0, 1.0)], False),
    ],
)
def test_a_straight_line(line: list[tuple[float, float]], is_straight: bool) -> None:
    assert _is_straight(line[0], line[1:-1], line[-1]) is is_straight


def test_points_are_rounded_to_millimetres(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.patrol.core.teaching.CORRIDOR", 0.4)
    teaching = taught(0.2504, (0.5006, 0.1234, 0.0))
    teaching.station("gate", 3.0)
    assert teaching.route(0.5).points[-1] == m.RoutePoint(x=0.501, y=0.123, station="gate", stay=3)
    assert teaching.route(0.5).corridor == 0.4


def test_as_far_backward_as_allowed_is_no_part_of_the_route() -> None:
    teaching = taught(0.2, 0.4, 0.2)
    assert teaching.reason is None
    teaching.station("gate", 0.0)
    assert teaching.summary[0] == pytest.approx(0.2)
    taught(0.4, 0.6, 0.8, of=teaching)
    assert [each.x for each in teaching.route(0.5).points] == [0.0, 0.2, 0.8]
    assert teaching.summary[0] == pytest.approx(0.8)


def test_how_far_backward_is_by_the_heading() -> None:
    places = (Pose(0.0, 0.0, 1.0).moved(step, 0.0) for step in (0.25, 0.5, 0.35))
    assert taught(*((each.x, each.y, 1.0) for each in places)).reason is None
    ended = taught(0.25, 0.5, 0.75, 0.5)
    assert ended.reason == Phrase("teach.backward")
    assert ended.route(0.5).points[-1].x == 0.75


def test_teaching_needs_a_known_position() -> None:
    with pytest.raises(Refused, match="lost"):
        Teaching("yard", "001", "home", 0.0, map_pose("lost"))


def test_a_small_loop_ends_at_home() -> None:
    lesson = Lesson()
    for _ in range(3):
        lesson.forward(0.4).turn(math.tau / 3)
    assert lesson.teaching.summary[0] == pytest.approx(1.2, abs=0.05)
    assert lesson.corners[0] == lesson.corners[-1] == HOME
    assert lesson.teaching.route(0.7).speed == 0.7


def test_which_loop_is_too_short_to_end_at_home() -> None:
    west = math.pi
    teaching = taught(0.25, 0.5, (0.5, 0.25, math.pi / 2), (0.25, 0.25, west))
    end = teaching.route(0.5).points[-1]
    assert (end.x, end.y) == (0.25, 0.25)  # after 1 m
    end = taught((0.0, 0.25, west), of=teaching).route(0.5).points[-1]
    assert (end.x, end.y) == HOME


def test_a_short_route_is_no_loop() -> None:
    assert Lesson().forward(0.6).corners == near([(0.0, 0.0), (0.6, 0.0)])


def test_coming_back_to_the_same_point_is_a_corner() -> None:
    teaching = Lesson().teaching
    for x, heading in ((0.12, 0.0), (0.12, math.pi), (0.0, math.pi), *WEST):
        teaching.on_pose(pose_at(Pose(x, 0.0, heading)))
    assert [each.x for each in teaching.route(0.5).points] == pytest.approx([0.0, 0.12, -0.8])


@pytest.mark.parametrize("distance", [0.0, 0.3])
def test_a_route_has_a_least_length(distance: float) -> None:
    with pytest.raises(Refused) as refused:
        Lesson().forward(distance).teaching.route(0.5)
    about: Any = {"length": pytest.approx(distance), "least": LEAST}
    assert refused.value.reason == Phrase("teach.short", about)


def test_what_was_taught_survives_a_restart() -> None:
    lesson = Lesson().forward(3.0).turn(1.0).forward(1.0)
    route = lesson.teaching.route(0.5)
    restored = Teaching.restored(lesson.teaching.open, "001")
    restored.on_pose(pose_at(Pose(9.0, 9.0, 0.0)))
    assert restored.reason
    assert restored.reason.name == "teach.restarted"
    assert restored.route(0.5) == route
