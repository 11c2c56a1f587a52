"""Newest messages and events of a robot."""

from msgspec.structs import replace

from common import keys
from common.freshness import NS_PER_S, Latest
from common.messages import Bumper, Drive, Driver, Event, Velocity
from services.dashboard.telemetry_cache import (
    EVENTS_MAX,
    FIXED,
    INVENTED_MAX,
    STATES_MAX,
    TelemetryCache,
)
from tests.factories import health, safety_state

BUMPER = "tel/bridge/bumper"


def event(number: int) -> Event:
    return Event(name="n", level="info", text=str(number), t_ns=number)


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


def test_events_are_sorted_by_the_senders_time_and_bounded() -> None:
    telemetry = TelemetryCache()
    for number in (2, 1, 3):
        telemetry.add_event("safety", event(number))
    assert [line.text for line in telemetry.events] == ["1", "2", "3"]
    for number in range(4, 4 + EVENTS_MAX):
        telemetry.add_event("bridge", event(number))
    assert len(telemetry.events) == EVENTS_MAX
    assert telemetry.events[0].text == "4"
    assert len(telemetry.new_events) == EVENTS_MAX


def test_an_event_of_any_length_costs_little() -> None:
    telemetry = TelemetryCache()
    telemetry.add_event("safety", replace(event(1), text="\x1b" * 4000))
    assert telemetry.events[0].text == "\\u001b" * 166 + "\\u00"


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
