"""Newest messages, rates, events and trajectory of a robot."""

import pytest

from common import keys
from common.freshness import NS_PER_S
from common.messages import Bumper, Drive, Driver, Event, Health, Velocity
from services.dashboard.telemetry_cache import (
    EVENTS_MAX,
    OTHERS,
    POINTS,
    SPACING_M,
    UNKNOWN_MAX,
    TelemetryCache,
    Trail,
    max_age_s,
    path_of,
)

BUMPER = "tel/bridge/bumper"
HEALTH = Health(
    service="safety", version="", uptime=1.0, rates={}, counters={}, lateness=0.0, rss=0
)


def event(number: int) -> Event:
    return Event(name="n", level="info", text=str(number), t_ns=number)


def test_an_empty_cache() -> None:
    telemetry = TelemetryCache()
    assert telemetry.newest(keys.BUMPER, 0) is None
    assert telemetry.services() == []


def test_the_newest_message_until_it_is_too_old() -> None:
    telemetry = TelemetryCache()
    telemetry.update(BUMPER, Bumper(pressed=False), 0)
    telemetry.update(BUMPER, Bumper(pressed=True), NS_PER_S)
    assert telemetry.newest(keys.BUMPER, NS_PER_S + NS_PER_S // 2) == Bumper(pressed=True)
    assert telemetry.newest(keys.BUMPER, NS_PER_S + NS_PER_S // 2 + 1) is None
    assert telemetry.ages_s(2 * NS_PER_S) == {BUMPER: 1.0}


def test_invented_names_share_an_entry_and_displace_nothing() -> None:
    telemetry = TelemetryCache()
    for number in range(1000):
        telemetry.update(f"@cmd/drive/{number}", Drive(linear=0.0, angular=0.0, echo=0), number)
    telemetry.update("tel/bridge/driver/left", Driver(faults=("under_voltage",), bits=8), NS_PER_S)
    telemetry.update("tel/safety/health", HEALTH, NS_PER_S)
    assert len(telemetry.ages_s(NS_PER_S)) == UNKNOWN_MAX + 3
    assert telemetry.ages_s(1999)[OTHERS] == 1000 / NS_PER_S
    assert telemetry.newest(keys.DRIVER, NS_PER_S, side="left") is not None
    assert telemetry.services() == ["safety"]


def test_slow_streams_have_a_longer_limit() -> None:
    assert (max_age_s(keys.BUMPER), max_age_s(keys.LINK)) == (0.5, 0.8)
    assert (max_age_s(keys.DRIVER), max_age_s(keys.HEALTH)) == (2.0, 3.0)


def test_a_message_of_another_type_is_not_returned() -> None:
    telemetry = TelemetryCache()
    telemetry.update(BUMPER, Velocity(linear=0.0, angular=0.0), 0)
    assert telemetry.newest(keys.BUMPER, 0) is None


def test_rates_cover_the_last_seconds() -> None:
    telemetry = TelemetryCache()
    telemetry.update_rates(0)
    for _ in range(20):
        telemetry.update(BUMPER, Bumper(pressed=False), 0)
    telemetry.update_rates(NS_PER_S // 2)
    assert telemetry.rates == {BUMPER: 40.0}
    telemetry.update_rates(3 * NS_PER_S)
    assert telemetry.rates == {BUMPER: pytest.approx(20 / 3)}
    telemetry.update_rates(4 * NS_PER_S)
    assert telemetry.rates == {}


def test_the_rate_of_a_slow_stream_is_constant() -> None:
    telemetry, seen = TelemetryCache(), set()
    for tick in range(40):
        if tick % 2:
            telemetry.update(BUMPER, Bumper(pressed=False), 0)
        telemetry.update_rates(tick * NS_PER_S // 2)
        if tick > 6:
            seen.add(telemetry.rates[BUMPER])
    assert seen == {1.0}


def test_events_are_sorted_by_the_senders_time_and_bounded() -> None:
    telemetry = TelemetryCache()
    for number in (2, 1, 3):
        telemetry.add_event("safety", event(number))
    assert [line.text for line in telemetry.events] == ["1", "2", "3"]
    for number in range(4, 4 + EVENTS_MAX):
        telemetry.add_event("bridge", event(number))
    assert len(telemetry.events) == EVENTS_MAX
    assert telemetry.events[0].text == "4"
    assert telemetry.event_count == EVENTS_MAX + 3


def test_services_by_token_or_by_health() -> None:
    telemetry = TelemetryCache()
    telemetry.update_liveliness("t2/v1/001/live/safety/a", True)
    telemetry.update_liveliness("t2/v1/001/live/safety/b", True)
    telemetry.update_liveliness("t2/v1/001/live/safety/a", False)
    health = Health(
        service="odom", version="1", uptime=1.0, rates={}, counters={}, lateness=0.0, rss=1
    )
    telemetry.update("tel/odom/health", health, 0)
    assert telemetry.services() == ["odom", "safety"]
    assert telemetry.alive == {"safety": {"b"}}


def test_the_path_behind_the_robot() -> None:
    assert path_of("t2/v1/001/tel/bridge/driver/left") == "tel/bridge/driver/left"


def test_near_points_are_skipped() -> None:
    trail = Trail()
    for x in (0.0, SPACING_M / 2, SPACING_M, SPACING_M * 1.5):
        assert not trail.add(x, 0.0, epoch=0)
    assert list(trail.points) == [(0.0, 0.0), (SPACING_M, 0.0)]


def test_a_new_epoch_clears_the_trail() -> None:
    trail = Trail()
    trail.add(0.0, 0.0, epoch=0)
    assert trail.add(5.0, 5.0, epoch=1)
    assert list(trail.points) == [(5.0, 5.0)]


def test_the_trail_is_bounded() -> None:
    trail = Trail()
    for x in range(POINTS + 1):
        trail.add(float(x), 0.0, epoch=0)
    assert len(trail.points) == POINTS
    assert trail.points[0] == (1.0, 0.0)


def test_stored_points_of_odometry_are_prepended() -> None:
    trail = Trail()
    trail.add(2.0, 0.0, epoch=4)
    trail.begin([(0.0, 0.0), (1.0, 0.0)], epoch=4)
    assert list(trail.points) == [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]
    trail.begin([(9.0, 9.0)], epoch=3)
    assert len(trail.points) == 3


def test_stored_points_may_come_first() -> None:
    trail = Trail()
    trail.begin([(1.0, 0.0)], epoch=2)
    assert trail.add(3.0, 0.0, epoch=3)
    assert list(trail.points) == [(3.0, 0.0)]
