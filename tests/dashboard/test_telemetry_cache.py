"""Newest messages and events of a robot."""

from typing import Any

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from services.dashboard.telemetry_cache import (
    EVENTS_MAX,
    FIXED,
    HISTORY_TURNS,
    INVENTED_MAX,
    STATES_MAX,
    TelemetryCache,
)
from t2 import keys
from t2.messages import Bumper, Cause, Drive, Driver, Event, Velocity
from tests.factories import health, safety_state

BUMPER = "tel/bridge/bumper"


def event(number: int) -> Event:
    return Event(name="slip", level="info", text=str(number), t_ns=number)


def test_the_newest_message_until_it_is_too_old() -> None:
    telemetry = TelemetryCache()
    telemetry.update(BUMPER, Bumper(pressed=False), 0)
    telemetry.update(BUMPER, Bumper(pressed=True), NS_PER_S)
    assert telemetry.newest(keys.BUMPER, NS_PER_S + NS_PER_S // 2) == Bumper(pressed=True)
    assert telemetry.newest(keys.BUMPER, NS_PER_S + NS_PER_S // 2 + 1) is None


def test_invented_names_are_bounded_and_displace_nothing() -> None:
    telemetry = TelemetryCache()
    for number in range(1000):
        telemetry.update(f"@cmd/drive/{number}", Drive(linear=0.0, angular=0.0, echo=0), number)
    telemetry.update("tel/bridge/driver/left", Driver(faults=("under_voltage",), bits=8), NS_PER_S)
    telemetry.update("tel/safety/health", health("safety"), NS_PER_S)
    assert len(telemetry._latest) <= len(FIXED) + INVENTED_MAX + 2
    assert telemetry.newest(keys.DRIVER, NS_PER_S, side="left") is not None
    assert telemetry.services() == ["safety"]


def test_a_message_of_another_type_is_not_returned() -> None:
    telemetry = TelemetryCache()
    telemetry.update(BUMPER, Velocity(linear=0.0, angular=0.0), 0)
    assert telemetry.newest(keys.BUMPER, 0) is None


def test_events_are_in_the_order_of_their_arrival_and_bounded() -> None:
    telemetry = TelemetryCache()
    for number in (*range(8 * 3600, 8 * 3600 + EVENTS_MAX), 100):  # a clock 8 h ahead, corrected
        telemetry.add_event("safety", event(number))
    assert len(telemetry.events) == EVENTS_MAX
    assert [telemetry.events[at].text.en for at in (0, -1)] == [str(8 * 3600 + 1), "100"]
    assert telemetry.take_new() == (telemetry.events, False)
    assert telemetry.take_new() == ([], False)
    telemetry.add_event("bridge", event(1))
    assert telemetry.take_new() == (telemetry.events[-1:], False)


def test_the_histories_of_a_host_are_merged_by_its_own_clock() -> None:
    telemetry = TelemetryCache()
    ahead = 8 * 3600  # of the wall clock, before a correction
    for service, monos in (("safety", (1, 4, 5)), ("bridge", (2, 3, 6))):
        for mono in monos:
            t = mono if mono > 3 else mono + ahead
            telemetry.add_event(service, replace(event(t), mono_ns=mono, host=7, text=str(mono)))
    telemetry.add_event("teleop", replace(event(9), mono_ns=0, host=8, text="another host"))
    lines, are_all = telemetry.take_new()
    assert [line.text.en for line in lines] == [*"123456", "another host"]
    assert are_all
    for _ in range(HISTORY_TURNS):  # later ones come when they come
        telemetry.add_event("safety", replace(event(9), mono_ns=9, host=7))
        telemetry.take_new()
    telemetry.add_event("bridge", replace(event(1), mono_ns=8, host=7, text="last"))
    assert telemetry.take_new()[1] is False
    assert telemetry.events[-1].text.en == "last"


def test_a_history_of_all_services_fits_and_lost_events_are_marked() -> None:
    telemetry = TelemetryCache()
    for service in keys.SERVICES:
        for seq in range(1, keys.EVENT.history + 1):
            telemetry.add_event(service, replace(event(seq), seq=seq, boot=1))
    assert len(telemetry._events) == keys.EVENT.history * len(keys.SERVICES)
    last = keys.EVENT.history
    for seq, boot in ((last + 4, 1), (last + 5, 1), (1, 2), (3, 2)):
        telemetry.add_event("safety", replace(event(seq), seq=seq, boot=boot))
    shown = [(line.name, line.text.en) for line in telemetry.events[-6:]]
    assert [text for name, text in shown if name == "gap"] == [
        "3 events are missing here.",
        "1 events are missing here.",
    ]
    assert [name for name, _ in shown] == ["gap", "slip", "slip", "slip", "gap", "slip"]


def test_an_event_of_any_length_costs_little() -> None:
    telemetry = TelemetryCache()
    telemetry.add_event("safety", replace(event(1), text="\x1b" * 4000))
    assert telemetry.events[0].text.en == "\\u001b" * 166 + "\\u00"


def test_services_by_token_or_by_health() -> None:
    telemetry = TelemetryCache()
    telemetry.update_liveliness("t2/v1/001/live/safety/a", True)
    telemetry.update_liveliness("t2/v1/001/live/safety/b", True)
    telemetry.update_liveliness("t2/v1/001/live/safety/a", False)
    telemetry.update("tel/odom/health", health("odom"), 0)
    assert telemetry.services() == ["odom", "safety"]
    assert telemetry.alive == {"safety": {"b"}}


def test_a_state_of_safety_is_found_by_its_heartbeat_while_it_is_new() -> None:
    telemetry = TelemetryCache()
    states = [safety_state(heartbeat=number) for number in range(1, STATES_MAX + 2)]
    for state in states:
        telemetry.update("tel/safety/state", state, 10 * state.heartbeat)
    assert telemetry.shown(2) == Latest(states[1], 20)
    assert telemetry.shown(STATES_MAX + 1) == Latest(states[-1], 10 * (STATES_MAX + 1))
    assert [telemetry.shown(number) for number in (0, 1, STATES_MAX + 2)] == [None] * 3


@pytest.mark.parametrize(
    ("host", "age_s", "by"),
    [
        (7, 0.5, "Bob"),  # the nearest one, although another one is as near as allowed
        (7, 3.2, "Anna"),
        (7, 60.0, "Eve"),
        (7, 20.0, None),
        (0, 0.5, "Bob"),  # of another computer, by its wall clock
    ],
)
def test_who_stopped_the_robot_is_known_by_the_event_near_the_latch(
    host: int, age_s: float, by: str | None
) -> None:
    cache, now_ns = TelemetryCache(), 100 * NS_PER_S
    clock = "mono_ns" if host else "t_ns"
    for name, ago_s in (("Eve", 61.0), ("Anna", 2.9), ("Bob", 0.5)):
        about: Any = {"about": {"by": name}, clock: now_ns - round(ago_s * NS_PER_S)}
        stop = Event(name="estop", level="warning", text="", host=host, **about)
        cache.add_event("dashboard", stop)
    cause = Cause(name="estop", action="brake", age=age_s, text="")
    state = safety_state(causes=(cause,), latched=("estop",), host=host, **{clock: now_ns})
    assert cache.stopped_by(state) == by
    assert cache.stopped_by(replace(state, latched=())) is None


def test_one_press_of_the_bumper_is_one_row() -> None:
    telemetry = TelemetryCache()
    contact = Event(name="contact", level="error", text="hit", host=1, mono_ns=NS_PER_S)
    telemetry.add_event("bridge", contact)
    telemetry.add_event("safety", replace(contact, mono_ns=NS_PER_S + 1))
    assert [line.service.zh for line in telemetry.events] == ["桥接服务"]
