"""Patrol on the page: its state, and the routes that are read once for all viewers."""

import json
import math
from typing import Any

import pytest

from common import clock
from common.freshness import NS_PER_S
from services.dashboard.i18n import Texts
from services.dashboard.patrol import DRAWN_MAX, KEPT_S, Routes, patrol_view, thinned
from services.dashboard.telemetry_cache import TelemetryCache
from t2 import keys
from t2.messages import (
    NextRound,
    PatrolState,
    Phrase,
    Refusal,
    Route,
    RoutePoint,
    RoutesReply,
    RoutesRequest,
    RouteSummary,
    Teaching,
)
from t2.words import render
from tests.factories import patrol_state
from tests.fake_bus import FakeBus

AT = 100 * NS_PER_S
YARD = Route(
    name="yard",
    robot="001",
    points=(
        RoutePoint(x=0.0, y=0.0, station="home"),
        RoutePoint(x=4.126, y=0.0),
        RoutePoint(x=4.0, y=3.0, station="gate", stay=5.0),
    ),
)
NO_HOME = (Phrase("route.no_home"),)
LIST = RoutesReply(
    routes=(
        RouteSummary(name="yard", length=7.1, stations=("home", "gate")),
        RouteSummary(name="old", problem=render(NO_HOME), phrases=NO_HOME),
    )
)


def with_state(state: PatrolState) -> TelemetryCache:
    telemetry = TelemetryCache()
    telemetry.update(keys.PATROL.path, state, AT)
    return telemetry


def test_a_robot_without_patrol_has_no_view() -> None:
    assert patrol_view(TelemetryCache(), 1, AT) is None


def test_the_view_of_a_round() -> None:
    following = NextRound(schedule="night", route="yard", t_ns=5 * NS_PER_S)
    view = patrol_view(with_state(patrol_state(next=following)), 3, AT)
    assert view is not None
    assert (view.state, view.word, view.version) == ("driving", Texts("driving", "行驶中"), 3)
    assert view.text.zh == "正在行驶路线 yard；下一站：gate。"
    assert (view.progress, view.length, view.left) == (4.0, 10.0, None)
    assert (view.deviation, view.sigma, view.corridor) == (0.1, 0.05, 0.5)
    assert view.actions == ("pause", "return", "abort")
    assert view.next is not None
    assert (view.next.schedule, view.next.t) == ("night", 5.0)


def test_the_view_of_teaching_has_why_nothing_more_is_recorded() -> None:
    phrases = (Phrase("teach.backward"),)
    teaching = Teaching(
        route="yard", length=3.0, points=9, stations=("home",), text="x", phrases=phrases
    )
    view = patrol_view(with_state(patrol_state("idle", teaching=teaching)), 1, AT)
    assert view is not None
    assert view.teaching is not None
    assert view.teaching.text.zh == "车辆曾后退行驶，而巡逻只能前进。"


def test_a_silent_patrol_shows_nothing_of_its_last_state() -> None:
    view = patrol_view(with_state(patrol_state()), 1, AT + 2 * NS_PER_S)
    assert view is not None
    assert (view.state, view.actions, view.route, view.progress) == (None, (), "", None)
    assert view.text.en.startswith("Patrol does not respond")


class RoutesFixture:
    """The routes of a robot, and what two viewers were sent."""

    def __init__(self) -> None:
        self.bus = FakeBus()
        self.routes = Routes(self.bus)
        self.sent: list[dict[str, Any]] = []

    def ask(self, name: str | None) -> None:
        self.routes.ask(name, lambda message: self.sent.append(json.loads(message)))


@pytest.fixture
def fixture() -> RoutesFixture:
    return RoutesFixture()


def test_a_route_is_read_once_for_all_viewers(fixture: RoutesFixture) -> None:
    fixture.ask("yard")
    fixture.ask("yard")
    assert fixture.bus.asked == [(keys.ROUTES.path, RoutesRequest(route="yard"))]
    fixture.bus.answers[-1][0](RoutesReply(route=YARD))
    fixture.ask("yard")
    assert len(fixture.bus.asked) == 1
    message = {
        "k": "route", "version": 0, "name": "yard", "corridor": 0.5,
        "points": [[0.0, 0.0], [4.13, 0.0], [4.0, 3.0]],
        "stations": [["home", 0.0, 0.0], ["gate", 4.0, 3.0]],
    }  # fmt: skip
    assert fixture.sent == [message] * 3


def test_the_list_has_the_problems(fixture: RoutesFixture) -> None:
    fixture.ask(None)
    fixture.bus.answers[-1][0](LIST)
    yard, old = fixture.sent[0]["routes"]
    assert yard == {"name": "yard", "length": 7.1, "stations": 2, "problem": None}
    assert (old["length"], old["problem"]["zh"]) == (None, "第一个点需要站点名称：起点。")


def test_a_refused_question_is_asked_again(fixture: RoutesFixture) -> None:
    fixture.ask("yard")
    fixture.bus.answers[-1][1](Refusal(text="no"))
    fixture.ask("yard")
    assert len(fixture.bus.asked) == 2
    assert fixture.sent == []


def test_a_route_is_read_again_after_a_time(
    fixture: RoutesFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clock, "now_ns", lambda: AT)
    fixture.ask("yard")
    fixture.bus.answers[-1][0](RoutesReply(route=YARD))
    monkeypatch.setattr(clock, "now_ns", lambda: AT + round((KEPT_S + 1) * NS_PER_S))
    fixture.ask("yard")
    assert len(fixture.bus.asked) == 2


def test_an_answer_from_before_a_change_is_dropped(fixture: RoutesFixture) -> None:
    fixture.ask("yard")
    fixture.routes.change()
    fixture.ask("yard")
    fixture.bus.answers[0][0](RoutesReply(route=YARD))
    assert fixture.sent == []
    fixture.bus.answers[1][0](RoutesReply(route=YARD))
    assert [each["version"] for each in fixture.sent] == [1]


def test_routes_are_read_anew_after_a_restart_a_round_and_teaching(fixture: RoutesFixture) -> None:
    teaching = Teaching(route="yard", length=3.0, points=9, stations=("home",))
    states = [
        patrol_state("idle"), patrol_state("idle", boot=1), patrol_state("idle", teaching=teaching),
        patrol_state("idle"), patrol_state(round="2-yard"),
    ]  # fmt: skip
    for version, state in enumerate(states, 1):
        for _ in range(2):
            fixture.routes.observe(state)
        assert fixture.routes.version == version


def test_a_long_route_keeps_its_ends_and_its_bends() -> None:
    corner = 4321
    line = [(0.1 * min(at, corner), 0.1 * max(0, at - corner)) for at in range(10_000)]
    found = thinned(line)
    assert len(found) <= DRAWN_MAX
    assert {line[0], line[corner], line[-1]} <= set(found)
    assert found == sorted(found, key=line.index)
    circle = [(math.cos(at / 1500), math.sin(at / 1500)) for at in range(9000)]
    gaps = [math.dist(*pair) for pair in zip(thinned(circle), thinned(circle)[1:], strict=False)]
    assert max(gaps) < 0.01
    assert thinned(line[:DRAWN_MAX]) == line[:DRAWN_MAX]
