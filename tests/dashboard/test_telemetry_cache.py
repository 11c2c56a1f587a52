"""The newest of everything, as long as it is worth showing."""

import pytest

from common import keys
from common.freshness import NS_PER_S
from common.messages import Bumper, Drive, Driver, Event, Health, Velocity
from services.dashboard.telemetry_cache import (
    EVENTS_KEPT,
    MADE_UP_KEPT,
    OTHERS,
    Heard,
    path_of,
    worth_s,
)

BUMPER = "tel/bridge/bumper"
HEALTH = Health(
    service="safety", version="", uptime=1.0, rates={}, counters={}, lateness=0.0, rss=0
)


def event(number: int) -> Event:
    return Event(name="n", level="info", text=str(number), t_ns=number)


def test_nothing_is_known_before_it_was_heard() -> None:
    heard = Heard()
    assert heard.newest(keys.BUMPER, 0) is None
    assert heard.services() == []


def test_the_newest_until_it_is_too_old() -> None:
    heard = Heard()
    heard.hear(BUMPER, Bumper(pressed=False), 0)
    heard.hear(BUMPER, Bumper(pressed=True), NS_PER_S)
    assert heard.newest(keys.BUMPER, NS_PER_S + NS_PER_S // 2) == Bumper(pressed=True)
    assert heard.newest(keys.BUMPER, NS_PER_S + NS_PER_S // 2 + 1) is None
    assert heard.ages_s(2 * NS_PER_S) == {BUMPER: 1.0}


def test_names_that_anybody_makes_up_share_an_entry_and_push_nothing_out() -> None:
    heard = Heard()
    for number in range(1000):
        heard.hear(f"@cmd/drive/{number}", Drive(linear=0.0, angular=0.0, echo=0), number)
    heard.hear("tel/bridge/driver/left", Driver(faults=("under_voltage",), bits=8), NS_PER_S)
    heard.hear("tel/safety/health", HEALTH, NS_PER_S)
    assert len(heard.ages_s(NS_PER_S)) == MADE_UP_KEPT + 3
    assert heard.ages_s(1999)[OTHERS] == 1000 / NS_PER_S
    assert heard.newest(keys.DRIVER, NS_PER_S, side="left") is not None
    assert heard.services() == ["safety"]


def test_slow_streams_are_worth_more() -> None:
    assert (worth_s(keys.BUMPER), worth_s(keys.LINK)) == (0.5, 0.8)
    assert (worth_s(keys.DRIVER), worth_s(keys.HEALTH)) == (2.0, 3.0)


def test_a_message_of_another_kind_is_not_shown() -> None:
    heard = Heard()
    heard.hear(BUMPER, Velocity(linear=0.0, angular=0.0), 0)
    assert heard.newest(keys.BUMPER, 0) is None


def test_rates_are_of_the_last_seconds() -> None:
    heard = Heard()
    heard.count(0)
    for _ in range(20):
        heard.hear(BUMPER, Bumper(pressed=False), 0)
    heard.count(NS_PER_S // 2)
    assert heard.rates == {BUMPER: 40.0}
    heard.count(3 * NS_PER_S)
    assert heard.rates == {BUMPER: pytest.approx(20 / 3)}
    heard.count(4 * NS_PER_S)
    assert heard.rates == {}


def test_the_rate_of_a_slow_stream_stands_still() -> None:
    heard, seen = Heard(), set()
    for tick in range(40):
        if tick % 2:
            heard.hear(BUMPER, Bumper(pressed=False), 0)
        heard.count(tick * NS_PER_S // 2)
        if tick > 6:
            seen.add(heard.rates[BUMPER])
    assert seen == {1.0}


def test_events_stand_in_the_order_of_their_senders_and_the_oldest_go() -> None:
    heard = Heard()
    for number in (2, 1, 3):
        heard.note("safety", event(number))
    assert [line.event.text for line in heard.events] == ["1", "2", "3"]
    for number in range(4, 4 + EVENTS_KEPT):
        heard.note("bridge", event(number))
    assert len(heard.events) == EVENTS_KEPT
    assert heard.events[0].event.text == "4"
    assert heard.told == EVENTS_KEPT + 3


def test_services_by_token_or_by_health() -> None:
    heard = Heard()
    heard.lives("t2/v1/001/live/safety/a", True)
    heard.lives("t2/v1/001/live/safety/b", True)
    heard.lives("t2/v1/001/live/safety/a", False)
    health = Health(
        service="odom", version="1", uptime=1.0, rates={}, counters={}, lateness=0.0, rss=1
    )
    heard.hear("tel/odom/health", health, 0)
    assert heard.services() == ["odom", "safety"]
    assert heard.alive == {"safety": {"b"}}


def test_the_path_behind_the_robot() -> None:
    assert path_of("t2/v1/001/tel/bridge/driver/left") == "tel/bridge/driver/left"
