"""The panel of patrol in a real browser, at a simulated safety and a simulated patrol."""

import math
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from common.bus.bus import Bus, Caller
from common.loop import Loop
from t2 import keys
from t2.messages import (
    Done,
    Phrase,
    PlaneFrame,
    RoundRequest,
    Route,
    RoutePoint,
    RoutesReply,
    RoutesRequest,
    RouteSummary,
    Teaching,
    TeachRequest,
)
from t2.words import done
from tests import factories
from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import BROWSER_MARKS, take_control, text, wait_for_text
from verification.harness.bus import bus_on, running
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS

LINE = (RoutePoint(x=0.0, y=0.0, station="home"), RoutePoint(x=4.0, y=0.0))
LIST = (
    RouteSummary(name="yard", length=4.0, stations=("home",)),
    RouteSummary(name="hall", length=9.0, stations=("home",)),
    RouteSummary(name="old", problem="It is broken."),
)
# Its origin is at (1, 1) of the map, and its x axis along y of the map.
ODOM = PlaneFrame(x=1.0, y=1.0, heading=math.pi / 2)
# Home, at (0, 0) of the map, is at (-1, 1) of ``odom``, the vehicle at (1.234, -0.4), the centre.
HOME = """(drawn) => {
  const it = document.querySelector('#trail');
  const [x, y] = [it.clientWidth / 2 + (-1 - 1.234) * 40, it.clientHeight / 2 - (1 + 0.4) * 40];
  const [red, green, blue] = it.getContext('2d').getImageData(x, y, 1, 1).data;
  return (green > 2 * red && green > 2 * blue) === drawn;
}"""
NOT_HOME = Phrase("patrol.not_home", {"distance": 7.0, "route": "hall", "corridor": 0.5})


class PatrolServer:
    """A patrol that answers calls, and refuses each start."""

    def __init__(self) -> None:
        self.rounds: list[RoundRequest] = []
        self.teachings: list[TeachRequest] = []
        self.read: list[str | None] = []  # names of routes; None: the list

    def declare(self, bus: Bus) -> None:
        bus.serve(keys.ROUTES, self.routes)
        bus.serve(keys.ROUND, self.round)
        bus.serve(keys.TEACH, self.teach)

    def routes(self, request: RoutesRequest, caller: Caller[RoutesReply]) -> None:
        self.read.append(request.route)
        if request.route is None:
            caller.reply(RoutesReply(routes=LIST))
        else:
            caller.reply(RoutesReply(route=Route(name=request.route, robot="001", points=LINE)))

    def round(self, request: RoundRequest, caller: Caller[Done]) -> None:
        self.rounds.append(request)
        if request.action == "start":
            caller.refuse(NOT_HOME)
        else:
            caller.reply(done(Phrase("patrol.done")))

    def teach(self, request: TeachRequest, caller: Caller[Done]) -> None:
        self.teachings.append(request)
        caller.reply(done(Phrase("patrol.done")))


@pytest.fixture
def patrol(endpoint: str, peer: Peer) -> Iterator[PatrolServer]:
    it = PatrolServer()
    peer.patrol, peer.map_pose = factories.patrol_state("idle"), factories.map_pose(odom=ODOM)
    with running(Loop()) as loop, bus_on(endpoint, loop, it.declare):
        yield it
    peer.patrol = peer.map_pose = None


@pytest.fixture
def page(patrol: PatrolServer, page_of_peer: Page) -> Page:
    page_of_peer.wait_for_selector("#route-list button")
    return page_of_peer


def buttons(page: Page, state: str = ":visible") -> list[str]:
    """Return the actions whose buttons are shown, or are in a state."""
    found = page.locator(f"[data-round]{state}").all()
    return [str(it.get_attribute("data-round")) for it in found]


def wait_for_state(page: Page, state: str) -> None:
    page.wait_for_selector(f"#patrol[data-state={state}]")


def wait_for_home(page: Page, *, drawn: bool) -> None:
    """Wait until the first station of the route is in the trajectory, or is not."""
    page.wait_for_function(HOME, arg=drawn, timeout=20_000)


def test_the_buttons_are_those_of_the_actions_and_of_the_driver(page: Page, peer: Peer) -> None:
    assert buttons(page) == ["start"]
    assert buttons(page, ":enabled") == []
    assert text(page, "#patrol-why") == "Take control first."
    take_control(page)
    page.wait_for_selector("[data-round=start]:enabled")
    peer.patrol = factories.patrol_state()
    wait_for_state(page, "driving")
    assert buttons(page) == ["pause", "return", "abort"]
    assert not page.is_visible("#routes")
    assert "4.0 m of 10.0 m" in text(page, "#patrol-facts")
    assert "0.10 ± 0.10 m (2σ), allowed 0.50 m" in text(page, "#patrol-facts")


def test_a_double_click_is_one_call_with_the_heartbeat_and_a_refusal_is_shown(
    page: Page, patrol: PatrolServer
) -> None:
    take_control(page)
    page.click("#route-list button:has-text('hall')")
    assert page.is_disabled("#route-list button:has-text('old')")
    page.wait_for_selector("[data-round=start]:enabled")
    assert text(page, "[data-round=start]") == "Start hall"
    page.dblclick("[data-round=start]")
    wait_for_text(page, "#toasts", "The vehicle is 7.00 m from home")
    wait_for_text(page, "#events", "Patrol, by viewer")
    page.wait_for_selector("[data-round=start]:enabled")  # the end of the lock
    assert [(it.action, it.route) for it in patrol.rounds] == [("start", "hall")]
    assert patrol.rounds[0].echo
    assert patrol.read[-1] == "hall"


def test_an_abort_asks_first(page: Page, patrol: PatrolServer, peer: Peer) -> None:
    take_control(page)
    peer.patrol = factories.patrol_state()
    page.click("[data-round=abort]")
    page.click("#question-no")
    page.click("[data-round=abort]")
    page.click("#question-yes")
    wait_until(lambda: bool(patrol.rounds), "the call")
    assert [it.action for it in patrol.rounds] == ["abort"]


def test_a_silent_patrol_says_so_and_has_no_buttons(page: Page, peer: Peer) -> None:
    take_control(page)
    peer.patrol = factories.patrol_state()
    wait_for_state(page, "driving")
    wait_for_home(page, drawn=True)
    peer.patrol = None
    wait_for_state(page, "silent")
    wait_for_home(page, drawn=False)
    assert "Patrol does not respond" in text(page, "#patrol-text")
    assert text(page, "#patrol-facts") == ""
    assert buttons(page) == []
    assert not page.is_visible("#patrol-bar, #routes, #teach")
    page.reload()
    wait_for_state(page, "silent")


def test_a_route_is_taught_and_the_reason_for_its_end_is_shown(
    page: Page, patrol: PatrolServer, peer: Peer
) -> None:
    take_control(page)
    page.click("#teach summary")
    page.fill("#route-name", "../yard")
    page.fill("#home-name", "home")
    page.wait_for_selector("[data-teach=begin]:enabled")
    page.click("[data-teach=begin]")
    wait_for_text(page, "#toasts", "A name has letters")
    page.fill("#route-name", "院子")
    page.click("[data-teach=begin]")
    phrases = (Phrase("teach.backward"),)
    peer.patrol = factories.patrol_state(
        "idle",
        actions=(),
        teaching=Teaching(
            route="院子", length=3.0, points=9, stations=("home",), text="x", phrases=phrases
        ),
    )
    wait_for_text(page, "#teaching-reason", "driven backward")
    page.fill("#station-name", "gate 1")
    page.fill("#station-stay", "2.5")
    page.wait_for_selector("[data-teach=station]:enabled")
    page.click("[data-teach=station]")
    wait_until(lambda: len(patrol.teachings) == 2, "the station")
    begun, marked = patrol.teachings
    assert (begun.action, begun.route, begun.station) == ("begin", "院子", "home")
    assert (marked.action, marked.station, marked.stay) == ("station", "gate 1", 2.5)


def test_the_route_that_was_taught_is_the_one_to_start(page: Page, peer: Peer) -> None:
    page.wait_for_selector("#route-list [aria-pressed=true]:has-text('yard')")
    taught = Teaching(route="hall", length=3.0, points=9, stations=("home",))
    peer.patrol = factories.patrol_state("idle", actions=(), teaching=taught)
    page.wait_for_selector("#teaching:visible")
    peer.patrol = factories.patrol_state("idle")
    page.wait_for_selector("#route-list [aria-pressed=true]:has-text('hall')")
