"""Robots and their pages, with fake buses and a time that the test sets."""

import json
from collections.abc import Callable, Collection
from typing import Any
from unittest.mock import Mock

import pytest
from msgspec.structs import asdict

from common import clock
from common.bus.bus import Arrival
from common.freshness import NS_PER_S
from services.dashboard import client_messages as client
from services.dashboard import fleet as module
from services.dashboard.config import DashboardConfig
from services.dashboard.driver_lock import HoldState
from services.dashboard.fleet import IDLE_S, KNOWN_MAX, PAGES_MAX, Fleet
from services.dashboard.i18n import label
from services.dashboard.robot_page import SLOW_TICKS
from t2 import keys
from t2.messages import Event, RoutesReply
from tests.factories import safety_state
from verification.harness.waiting import wait_until

Sent = tuple[list[str], dict[str, Any]]


@pytest.fixture
def buses(monkeypatch: pytest.MonkeyPatch) -> dict[str, Mock]:
    """Return the buses that are open, by robot."""
    opened: dict[str, Mock] = {}

    def bus(_endpoints: object, robot: str, *_: object) -> Mock:
        opened[robot] = Mock(robot=robot, connected=True, where=DashboardConfig().bus)
        return opened[robot]

    monkeypatch.setattr(module, "Bus", bus)
    return opened


@pytest.fixture
def sent() -> list[Sent]:
    """Return the messages to the viewers."""
    return []


@pytest.fixture
def fleet(sent: list[Sent]) -> Fleet:
    def send(viewers: Collection[str], text: bytes, _replaces: bool) -> None:
        sent.append((sorted(viewers), json.loads(text)))

    fleet = Fleet(Mock(config=DashboardConfig()))
    fleet.send = send
    return fleet


def note_alive(fleet: Fleet, robot: str, alive: bool, service: str = "safety") -> None:
    _, note = fleet._node.bus.watch_live.call_args.args  # type: ignore[attr-defined]
    note(keys.live_key(robot, service, "1"), alive)


def subscriptions(bus: Mock) -> dict[str, Callable[[Arrival[Any]], None]]:
    """Return the handlers of a bus by the path of their topic."""
    return {call.args[0].path: call.args[1] for call in bus.subscribe.call_args_list}


def test_a_robot_is_known_by_the_settings_alive_before_or_shown(
    fleet: Fleet, buses: dict[str, Mock]
) -> None:
    assert fleet.knows("001")
    assert not fleet.knows("made-up")
    for alive in (True, False):
        note_alive(fleet, "002", alive)
        note_alive(fleet, "two words", alive)
        note_alive(fleet, "999", alive, "dashboard")
    assert fleet.knows("002")
    assert not fleet.knows("two words")
    assert not fleet.knows("999")  # a laptop's dashboard for it
    fleet.join("003", "1")
    assert fleet.knows("003")
    fleet.leave("003", "1")
    fleet.tick(clock.now_ns() + round((IDLE_S + 1) * NS_PER_S))
    assert not fleet.knows("003")


def test_the_settings_robot_is_stopped_by_the_session_that_is_open(
    fleet: Fleet, buses: dict[str, Mock]
) -> None:
    fleet.estop("001", "a test")
    assert buses["001"].estop.called
    assert fleet._node.bus.estop.called  # type: ignore[attr-defined]


def test_robots_that_left_are_forgotten_beyond_a_number(fleet: Fleet) -> None:
    for alive in (True, False):
        for name in ("001", *(f"made-up-{number}" for number in range(1000))):
            note_alive(fleet, name, alive)
    assert fleet.knows("001")
    assert len(fleet._alive) == KNOWN_MAX


def test_a_page_without_viewers_is_closed(fleet: Fleet, buses: dict[str, Mock]) -> None:
    fleet.join("001", "1")
    fleet.join("002", "2")
    fleet.leave("002", "2")
    fleet.estop("003", "somebody")
    buses["003"].connected = False  # it is still being looked for
    fleet.tick(clock.now_ns() + round((IDLE_S + 1) * NS_PER_S))
    wait_until(lambda: buses["002"].close.called, "the end of its session")
    assert not buses["001"].close.called
    assert not buses["003"].close.called
    first = buses["002"]
    fleet.join("002", "2")
    assert buses["002"] is not first


def test_fifty_robots_are_listed_some_shown_and_any_stopped(
    fleet: Fleet, buses: dict[str, Mock], sent: list[Sent]
) -> None:
    names = [f"berlin-{number:03d}" for number in range(1, 51)]
    for name in names:
        note_alive(fleet, name, True)
    note_alive(fleet, names[-1], False)
    for name in names[: PAGES_MAX + 1]:
        fleet.join(name, name)
    assert set(buses) == set(names[:PAGES_MAX])
    refused = {"k": "notice", "level": "warning", "text": asdict(label("too_many_robots"))}
    assert sent[-1] == ([names[PAGES_MAX]], refused)
    fleet.handle(names[PAGES_MAX], names[PAGES_MAX], client.Take())  # of the one without a page
    fleet.estop(names[-2], "somebody")
    assert buses[names[-2]].estop.called
    for tick in range(SLOW_TICKS):
        fleet.tick(clock.now_ns() + tick)
    listed = next(message["robots"] for _, message in sent if message["k"] == "slow")
    assert listed == {"001": False} | dict.fromkeys(names, True) | {names[-1]: False}


def receive(bus: Mock, topic: keys.Topic[Any], message: Any, **names: str) -> None:
    key = topic.on("001", **names)
    subscriptions(bus)[topic.path](Arrival(message, key, clock.now_ns(), None))


def test_only_new_events_are_sent(fleet: Fleet, buses: dict[str, Mock], sent: list[Sent]) -> None:
    def events() -> list[tuple[list[str], list[str]]]:
        found = [(to, it["lines"]) for to, it in sent if it["k"] == "events"]
        sent.clear()
        return [(to, [line["text"]["en"] for line in lines]) for to, lines in found]

    def after(*texts: str) -> list[tuple[list[str], list[str]]]:
        for t_ns, text in enumerate(texts):
            event = Event(name="stop", level="info", text=text, t_ns=t_ns)
            receive(buses["001"], keys.EVENTS, event, service="safety")
        for _ in range(SLOW_TICKS):
            fleet.tick(clock.now_ns())
        return events()

    fleet.join("001", "1")
    assert events() == [(["1"], [])]
    assert after("first", "second") == [(["1"], ["Stopped: first", "Stopped: second"])]
    assert after("third\x1b") == [(["1"], ["Stopped: third\\u001b"])]
    assert after() == []
    fleet.join("001", "2")
    assert [(to, len(texts)) for to, texts in events()] == [(["2"], 3)]
    assert after("fourth") == [(["1", "2"], ["Stopped: fourth"])]


def test_one_viewer_drives_and_a_takeover_asks(
    fleet: Fleet, buses: dict[str, Mock], sent: list[Sent]
) -> None:
    for viewer in ("1", "2"):
        fleet.join("001", viewer)
    lock = fleet._pages["001"].robot.driver_lock
    receive(buses["001"], keys.SAFETY, safety_state(heartbeat=5))
    fleet.handle("001", "1", client.Take(name="Anna"))
    assert lock.name == "Anna"
    for message in (client.Hold(5, x=1.0), client.Leave(), client.Gear(2), client.Reset(5)):
        fleet.handle("001", "2", message)
    assert (lock.state, lock.gear) == (HoldState.FREE, 1)
    assert not buses["001"].call.called
    fleet.handle("001", "1", client.Hold(5, x=1.0))
    fleet.handle("001", "2", client.Free())
    assert lock.state is HoldState.HELD
    fleet.handle("001", "2", client.Take())
    assert sent[-2][1]["text"]["en"] == "Take control first."
    assert sent[-1] == (["2"], {"k": "taken"})
    assert lock.driver == "1"
    fleet.handle("001", "2", client.Take(force=True))
    assert lock.driver == "2"
    text = {"en": "viewer 2 has taken over control.", "zh": "观看者 2 已接管控制权。"}
    assert [(to, it["text"]) for to, it in sent[-1:]] == [(["1"], text)]
    assert lock.name == ""
    fleet.handle("001", "2", client.Gear(3))
    assert lock.gear == 3
    fleet.leave("001", "2")
    assert lock.driver is None


def test_giving_up_control_is_an_event_once(fleet: Fleet, buses: dict[str, Mock]) -> None:
    fleet.join("001", "1")
    for closes in (False, True):
        fleet.handle("001", "1", client.Take(name="Anna"))
        fleet.handle("001", "2", client.Leave())
        for _ in range(2):
            if closes:
                fleet.leave("001", "1")
            else:
                fleet.handle("001", "1", client.Leave())
    put = [call.args[0] for call in buses["001"].publisher.return_value.put.call_args_list]
    events = [(it.name, it.about) for it in put if isinstance(it, Event)]
    assert events == [("take", {"by": "Anna"}), ("leave", {"by": "Anna"})] * 2


def test_a_reset_of_an_unknown_state_is_refused(
    fleet: Fleet, buses: dict[str, Mock], sent: list[Sent]
) -> None:
    fleet.join("001", "1")
    fleet.handle("001", "1", client.Take())
    receive(buses["001"], keys.SAFETY, safety_state(heartbeat=5))
    fleet.handle("001", "1", client.Reset(4))
    assert sent[-1][1]["text"]["en"].startswith("Reset refused. The call refers to an unknown")
    assert not buses["001"].call.called
    fleet.handle("001", "1", client.Reset(5))
    assert buses["001"].call.call_args.args[1].echo == 5


def test_a_viewer_reads_routes_and_only_the_driver_makes_calls_to_patrol(
    fleet: Fleet, buses: dict[str, Mock], sent: list[Sent]
) -> None:
    for viewer in ("1", "2"):
        fleet.join("001", viewer)
    fleet.handle("001", "1", client.Take())
    fleet.handle("001", "2", client.Routes())
    call, _, answered, _ = buses["001"].call.call_args.args
    assert call is keys.ROUTES
    answered(RoutesReply())
    assert sent[-1] == (["2"], {"k": "routes", "version": 0, "routes": []})
    calls: dict[Any, client.AnyMessage] = {
        keys.ROUND: client.Round(action="pause", echo=5),
        keys.TEACH: client.Teach(action="end", echo=5),
    }
    for number, (expected, asked) in enumerate(calls.items(), 1):
        fleet.handle("001", "2", asked)
        assert buses["001"].call.call_count == number
        notices = [(to, it["text"]["en"]) for to, it in sent if it["k"] == "notice"]
        assert notices == [(["2"], "Take control first.")] * number
        fleet.handle("001", "1", asked)
        assert buses["001"].call.call_args.args[0] is expected
