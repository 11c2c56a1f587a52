"""Robots and viewers, with fake buses and a time that the test sets."""

import json
from collections.abc import Callable, Collection
from typing import Any
from unittest.mock import Mock

import pytest

from common import clock, keys
from common.bus.bus import Arrival
from common.freshness import NS_PER_S
from common.messages import Event
from services.dashboard import client_messages as client
from services.dashboard import fleet as module
from services.dashboard.config import DashboardConfig
from services.dashboard.fleet import IDLE_S, KNOWN_MAX, ROBOTS_MAX, SLOW_TICKS, Fleet
from verification.harness.waiting import wait_until


@pytest.fixture
def buses(monkeypatch: pytest.MonkeyPatch) -> dict[str, Mock]:
    """Return the buses that are open_page, by robot."""
    opened: dict[str, Mock] = {}

    def bus(_endpoints: object, robot: str, *_: object) -> Mock:
        opened[robot] = Mock(robot=robot, connected=True)
        return opened[robot]

    monkeypatch.setattr(module, "Bus", bus)
    return opened


@pytest.fixture
def fleet() -> Fleet:
    return Fleet(Mock(config=DashboardConfig()), Mock())


def test_an_unknown_robot_is_not_stopped(fleet: Fleet, buses: dict[str, Mock]) -> None:
    fleet.join("1")
    assert fleet.knows("001")  # by the settings, alive or not
    assert not fleet.knows("made-up")
    fleet.handle("1", client.Estop("made-up"))
    assert buses == {}
    fleet.handle("1", client.Estop("001"))
    assert buses["001"].estop.called
    assert fleet._node.bus.estop.called  # type: ignore[attr-defined]


def test_a_robot_is_known_after_it_was_alive_or_while_it_has_viewers(
    fleet: Fleet, buses: dict[str, Mock]
) -> None:
    _, note_alive = fleet._node.bus.watch_live.call_args.args  # type: ignore[attr-defined]
    token = keys.live_key("002", "safety", "1")
    note_alive(token, True)
    note_alive(token, False)
    assert fleet.knows("002")
    fleet.join("1")
    fleet.handle("1", client.Look("003"))
    assert fleet.knows("003")
    fleet.handle("1", client.Look("002"))
    fleet.tick(clock.now_ns() + round((IDLE_S + 1) * NS_PER_S))
    assert not fleet.knows("003")
    assert fleet.knows("002")


def test_robots_that_left_are_forgotten_beyond_a_number(fleet: Fleet) -> None:
    _, note_alive = fleet._node.bus.watch_live.call_args.args  # type: ignore[attr-defined]
    for alive in (True, False):
        for name in ("001", *(f"made-up-{number}" for number in range(5000))):
            note_alive(keys.live_key(name, "safety", "1"), alive)
    assert fleet.knows("001")
    assert len(fleet._alive) == KNOWN_MAX
    note_alive(keys.live_key("002", "safety", "1"), True)
    assert fleet.knows("002")


def test_a_robot_without_viewers_is_closed(fleet: Fleet, buses: dict[str, Mock]) -> None:
    fleet.join("1")
    fleet.handle("1", client.Look("002"))
    fleet.estop("003", "somebody")
    now_ns = clock.now_ns()
    fleet.tick(now_ns)
    fleet.handle("1", client.Look("001"))
    late_ns = now_ns + round((IDLE_S + 1) * NS_PER_S)
    buses["003"].connected = False  # it is still being looked for
    fleet.tick(late_ns)
    wait_until(lambda: buses["002"].close.called, "the end of its session")
    assert not buses["001"].close.called
    assert not buses["003"].close.called
    first = buses["002"]
    fleet.handle("1", client.Look("002"))
    assert buses["002"] is not first
    assert not buses["002"].close.called


def test_fifty_robots_are_listed_some_open_and_any_stopped(buses: dict[str, Mock]) -> None:
    shown: list[bytes] = []
    node = Mock(config=DashboardConfig())
    fleet = Fleet(node, lambda _viewers, text, _newer_wins: shown.append(text))
    _, note_alive = node.bus.watch_live.call_args.args
    names = [f"berlin-{number:03d}" for number in range(1, 51)]
    for name in names:
        note_alive(keys.live_key(name, "safety", "1"), True)
    note_alive(keys.live_key(names[-1], "safety", "1"), False)
    fleet.join("1")
    for name in names[: ROBOTS_MAX + 1]:
        fleet.handle("1", client.Look(name))
    assert set(buses) == {"001", *names[: ROBOTS_MAX - 1]}  # the settings' robot is one of them
    assert b"too_many_robots" in b"".join(shown)
    fleet.estop(names[-2], "somebody")
    assert buses[names[-2]].estop.called
    shown.clear()
    for tick in range(SLOW_TICKS):
        fleet.tick(clock.now_ns() + tick)
    (rest,) = (json.loads(text) for text in shown if b'"k":"slow"' in text)
    assert rest["robots"] == {"001": False} | dict.fromkeys(names, True) | {names[-1]: False}


def test_a_new_name_does_not_restore_the_trail(buses: dict[str, Mock]) -> None:
    shown: list[bytes] = []
    fleet = Fleet(
        Mock(config=DashboardConfig()), lambda _viewers, text, _newer_wins: shown.append(text)
    )

    def paths() -> int:
        return sum(b'"path"' in text for text in shown)

    fleet.join("1")
    fleet.handle("1", client.Look("001"))
    assert paths() == 1
    fleet.handle("1", client.Look("001", "Ada"))
    assert paths() == 1
    assert b'"Ada"' in shown[-1]
    fleet.handle("1", client.Look("002", "Ada"))
    assert paths() == 2
    assert set(buses) == {"001", "002"}


def test_only_new_events_are_sent(buses: dict[str, Mock]) -> None:
    shown: list[tuple[list[str], dict[str, Any]]] = []

    def send(viewers: Collection[str], text: bytes, _replaces: bool) -> None:
        if b'"k":"events"' in text:
            shown.append((sorted(viewers), json.loads(text)))

    fleet = Fleet(Mock(config=DashboardConfig()), send)

    def sent(*texts: str) -> list[tuple[list[str], bool, list[str]]]:
        on_event = subscriptions(buses["001"])[keys.EVENTS.path]
        for t_ns, text in enumerate(texts):
            event = Event(name="stop", level="info", text=text, t_ns=t_ns)
            on_event(Arrival(event, keys.EVENTS.on("001", service="safety"), 0, None))
        shown.clear()
        for _ in range(SLOW_TICKS):
            fleet.tick(clock.now_ns())
        return [(to, one["all"], [line["text"] for line in one["lines"]]) for to, one in shown]

    fleet.join("1")
    fleet.handle("1", client.Look("001"))
    assert sent("first", "second") == [(["1"], True, ["first", "second"])]
    assert sent("third\x1b") == [(["1"], False, ["third\\u001b"])]
    assert sent() == []
    fleet.join("2")
    fleet.handle("2", client.Look("001"))
    everything = sent("fourth")
    assert (["1"], False, ["fourth"]) in everything
    assert [(to, len(texts)) for to, whole, texts in everything if whole] == [(["2"], 4)]


def subscriptions(bus: Mock) -> dict[str, Callable[[Arrival[Any]], None]]:
    """Return the handlers of a bus by the path of their topic."""
    return {call.args[0].path: call.args[1] for call in bus.subscribe.call_args_list}
