"""The driver of one robot on the dashboard: overruled by another source, or without permission."""

import math
from typing import Any

import pytest
from msgspec.structs import replace

from common import clock
from common.bus.publisher import Publisher
from common.freshness import NS_PER_S
from services.dashboard import client_messages as client
from services.dashboard import robot
from services.dashboard.config import DashboardConfig
from services.dashboard.driver_lock import HoldState, Push
from services.dashboard.i18n import Texts, phrase
from services.dashboard.robot import ESTOP_KEPT_S, Robot
from t2 import keys
from t2.client import DENIED_AFTER, ESTOP_TICKS, KEPT_TICKS, OVERRULED_TICKS
from t2.keys import Call
from t2.messages import (
    Direction,
    Done,
    Drive,
    Event,
    Level,
    Phrase,
    Refusal,
    ResetDone,
    ResetRequest,
    RoundRequest,
    TeachRequest,
)
from t2.words import render
from tests.dashboard.servers import CONTACT, NEWER
from tests.factories import patrol_state, safety_state
from tests.fake_bus import FakeBus

TICK_NS = 50_000_000
DONE = ResetDone(text=phrase("reset.done").en, phrases=(Phrase("reset.done"),))
UNCONFIRMED = phrase("event.estop_unconfirmed").en
NOT_CONFIRMED = phrase("event.reset_unconfirmed").en


class RobotFixture:
    """A robot whose driver holds the stick forward, with a state of safety in each tick."""

    def __init__(self) -> None:
        self.bus = FakeBus()
        self.notices: list[tuple[Level, str]] = []  # in English
        self.robot = Robot(
            self.bus,
            DashboardConfig(),
            self.notify,
        )
        self.now_ns = 0
        self.delay_ns = 0  # of the browser's answers
        self.release: Direction | None = None
        self.latched: tuple[str, ...] = ()
        assert self.robot.driver_lock.take("1", force=False)

    def notify(self, level: Level, text: Texts) -> None:
        self.notices.append((level, text.en))

    def ticks(self, number: int, source: str | None, *, held: bool = True) -> None:
        lock = self.robot.driver_lock
        for _ in range(number):
            self.now_ns += TICK_NS
            state = safety_state(heartbeat=self.now_ns, source=source, latched=self.latched)
            self.bus.deliver(keys.SAFETY, state, self.now_ns)
            if held:
                push = Push(release=self.release) if self.release else Push(1.0)
                shown = self.robot.telemetry.shown(self.now_ns - self.delay_ns)
                lock.hold(push, shown, self.now_ns)
            else:
                lock.let_go()
            self.robot.tick(self.now_ns)

    def is_held(self) -> bool:
        """Whether the hold is valid; otherwise the driver must let go first."""
        return self.robot.driver_lock.state is HoldState.HELD

    def overruled_by(self) -> str | None:
        driver = self.robot.driver_state()
        return driver.other if driver.overruled else None


@pytest.fixture
def fixture() -> RobotFixture:
    return RobotFixture()


def test_a_driver_who_is_overruled_must_let_go_first(fixture: RobotFixture) -> None:
    fixture.ticks(5, "web")
    fixture.ticks(OVERRULED_TICKS - 1, "teleop")
    assert fixture.overruled_by() is None  # our first requests may be on their way
    assert fixture.is_held()
    fixture.ticks(1, "teleop")
    assert not fixture.is_held()
    assert fixture.overruled_by() == "teleop"
    fixture.ticks(20, None)
    assert fixture.overruled_by() is None
    assert not fixture.is_held()
    fixture.ticks(1, None, held=False)
    fixture.ticks(5, "web")
    assert fixture.is_held()


def test_a_request_echoes_what_the_driver_was_shown_and_a_zero_the_newest(
    fixture: RobotFixture,
) -> None:
    requests = next(p for p in fixture.bus.publishers if p.topic is keys.DRIVE)
    fixture.ticks(5, "web")
    fixture.delay_ns = 3 * TICK_NS
    fixture.ticks(1, "web")
    assert isinstance(requests.last, Drive)
    assert (requests.last.linear, requests.last.echo) == (0.2, fixture.now_ns - 3 * TICK_NS)
    fixture.ticks(1, "web", held=False)
    assert (requests.last.linear, requests.last.echo) == (0.0, fixture.now_ns)


def test_a_release_is_requested_after_a_neutral_request(fixture: RobotFixture) -> None:
    requests = next(p for p in fixture.bus.publishers if p.topic is keys.DRIVE)
    directions: tuple[Direction, ...] = ("backward", "forward")
    for fixture.release in (None, *directions):
        for expected in ("none", fixture.release or "none"):
            fixture.ticks(1, "web")
            assert isinstance(requests.last, Drive)
            assert requests.last.release == expected


def test_a_repeated_estop_is_one_event(fixture: RobotFixture) -> None:
    events = next(p for p in fixture.bus.publishers if p.topic is keys.EVENTS)
    fixture.robot.telemetry.update("tel/safety/state", safety_state(), clock.now_ns())
    fixture.robot.estop("Anna")
    assert isinstance(events.last, Event)
    first = events.last.seq
    stopped = safety_state(latched=("estop",))
    fixture.robot.telemetry.update("tel/safety/state", stopped, clock.now_ns())
    for _ in range(KEPT_TICKS):  # safety has latched it, and the page's second request arrives
        fixture.robot.tick(clock.now_ns())
    fixture.robot.estop("Anna")
    assert events.last.seq == first


def test_an_unconfirmed_estop_is_reported_and_a_viewer_has_no_driver(
    fixture: RobotFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    fixture.robot.estop("a test", ESTOP_KEPT_S)
    fixture.ticks(ESTOP_TICKS, None)
    assert fixture.notices == [("error", UNCONFIRMED)]
    monkeypatch.setattr(Publisher, "passed_on", False)
    fixture.ticks(DENIED_AFTER, None)
    driver = fixture.robot.driver_state()
    assert (driver.may, driver.id) == (False, None)
    fixture.robot.estop("a test")
    fixture.ticks(ESTOP_TICKS, None)
    barred, denied = (text for _, text in fixture.notices[1:])
    assert barred.startswith("NOT ALLOWED: ")
    assert "probably not allowed" in denied


@pytest.mark.parametrize(("age_s", "kept_s"), [(0.0, 30.0), (20.0, 10.0), (1e9, 0.0), (-9.0, 30.0)])
def test_an_estop_is_repeated_while_the_robot_is_cut_off_and_the_stop_is_young(
    fixture: RobotFixture, monkeypatch: pytest.MonkeyPatch, age_s: float, kept_s: float
) -> None:
    monkeypatch.setattr(clock, "now_ns", lambda: fixture.now_ns)
    fixture.robot.estop("a test", age_s)
    rounds = math.ceil(kept_s * NS_PER_S / TICK_NS / ESTOP_TICKS)
    for _ in range(ESTOP_TICKS * (rounds + 2)):  # no state of safety
        fixture.now_ns += TICK_NS
        fixture.robot.tick(fixture.now_ns)
    assert fixture.bus.estops == 1 + ESTOP_TICKS * max(1, rounds)
    assert set(fixture.notices) == {("error", UNCONFIRMED)}


@pytest.fixture
def reset(fixture: RobotFixture) -> RobotFixture:
    """A driver who has reset a contact, after which safety published a newer one."""
    for heartbeat, cause in ((1, CONTACT), (2, NEWER)):
        state = safety_state(heartbeat=heartbeat, latched=("contact",), causes=(cause,))
        fixture.bus.deliver(keys.SAFETY, state, 0)
    fixture.robot.reset(1, "Anna", fixture.notify)
    return fixture


@pytest.mark.parametrize(
    ("boot", "latched", "notice"),
    [
        (0, (), ("info", DONE.text)),
        (0, ("estop",), ("warning", DONE.text)),
        (1, (), ("error", NOT_CONFIRMED)),  # an answer that is not safety's
    ],
)
def test_a_reset_is_confirmed_by_the_state_of_safety(
    reset: RobotFixture, boot: int, latched: tuple[str, ...], notice: tuple[Level, str]
) -> None:
    assert reset.bus.asked == [(keys.RESET.path, ResetRequest(echo=1, causes=(CONTACT.id,)))]
    done = replace(DONE, boot=boot, heartbeat=3, cleared=(CONTACT.id,))
    reset.bus.answers[-1][0](done)
    assert reset.notices == []
    reset.latched = latched
    reset.ticks(40 if boot else 1, "web")
    assert reset.notices == [notice]


def test_a_refusal_is_reported(reset: RobotFixture) -> None:
    phrase = Phrase("call.late", {"age": 1.4, "limit": 1.0})
    reset.bus.answers[-1][1](Refusal(text="late", phrases=(phrase,)))
    expected = "Reset refused. The call is 1.4 s old, allowed is 1 s: repeat it."
    assert reset.notices == [("warning", expected)]


def test_an_event_names_who_stopped_and_who_reset(reset: RobotFixture) -> None:
    events = next(p for p in reset.bus.publishers if p.topic is keys.EVENTS)
    assert isinstance(events.last, Event)
    assert (events.last.name, events.last.text) == ("reset_request", "Reset pressed by Anna.")
    for name in ("Bob", "viewer 3"):
        reset.robot.estop(name)
        assert isinstance(events.last, Event)
        text = f"Emergency stop by {name}."
        assert (events.last.name, events.last.text, events.last.about) == (
            "estop",
            text,
            {"by": name},
        )
    assert render(events.last.phrases, "zh") == "观看者 3 触发了急停。"


def test_an_event_names_the_certificate(
    fixture: RobotFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot, "common_name", lambda _: "driver.hall")
    events = next(p for p in fixture.bus.publishers if p.topic is keys.EVENTS)
    fixture.robot.estop("Anna")
    assert isinstance(events.last, Event)
    assert events.last.text == "Emergency stop by Anna. Certificate: driver.hall."


@pytest.mark.parametrize(
    ("asked", "call", "request_", "text"),
    [
        (
            client.Round(action="start", route="yard", echo=7),
            keys.ROUND,
            RoundRequest(action="start", route="yard", echo=7),
            "Patrol, by Anna: start.",
        ),
        (
            client.Teach(action="station", station="gate", stay=2.0, echo=7),
            keys.TEACH,
            TeachRequest(action="station", station="gate", stay=2.0, echo=7),
            "Patrol, by Anna: mark a station.",
        ),
    ],
)
def test_a_call_to_patrol_has_the_echo_of_the_page_and_is_one_event(
    fixture: RobotFixture,
    asked: client.Round | client.Teach,
    call: Call[Any, Any],
    request_: object,
    text: str,
) -> None:
    events = next(p for p in fixture.bus.publishers if p.topic is keys.EVENTS)
    fixture.robot.patrol(asked, "Anna", fixture.notify)
    assert fixture.bus.asked == [(call.path, request_)]
    assert isinstance(events.last, Event)
    assert (events.last.name, events.last.text) == ("round_request", text)
    answered, refused = fixture.bus.answers[-1]
    refused(Refusal(text="late", phrases=(Phrase("teach.none"),)))
    answered(Done(text="Done.", phrases=(Phrase("patrol.done"),)))
    assert fixture.notices == [("warning", "No route is being taught."), ("info", "Done.")]


def test_a_changed_route_is_read_anew(fixture: RobotFixture) -> None:
    assert fixture.robot.routes.version == 0
    fixture.bus.deliver(keys.PATROL, patrol_state())
    for service, version in (("patrol", 2), ("recorder", 2)):
        changed = Event(name="route_changed", level="info", text="")
        fixture.bus.deliver(
            keys.EVENTS, changed, service=service, declared=keys.EVENTS.on("001", service="*")
        )
        assert fixture.robot.routes.version == version
