"""Speed limits and kept emergency stops of third parties through the whole decision."""

from typing import Any

import pytest

from common.motion import STILL
from services.safety.config import LimitSource, Safety, SafetyConfig
from services.safety.core.inputs import LimitRequest
from t2.messages import Limit
from t2.words import render
from tests.safety.core.policy_fixture import LET_GO, PolicyFixture

LEASE_S, LEASE_NS = 0.5, 500_000_000
SOURCES = {
    "lidar": LimitSource(lease=LEASE_S, silence="stop"),
    "fleet": LimitSource(lease=LEASE_S, silence="ignore"),
}


def configured(**settings: Any) -> SafetyConfig:
    return SafetyConfig(safety=Safety(**settings))


IGNORED = configured(limits={"lidar": LimitSource(lease=LEASE_S, silence="ignore")})
NEEDED = configured(limits=SOURCES)
KEPT = configured(limits={"pendant": LimitSource(lease=1.0, silence="latch")})


def test_a_cap_that_falls_is_reached_at_the_normal_deceleration() -> None:
    fixture = PolicyFixture(IGNORED).running(1.0)
    speeds = []
    for _ in range(80):
        fixture.tick()
        fixture.limit(0.2, reason="person at 2 m")
        speeds.append(fixture.request(1.0).twist.linear)
    for n, speed in enumerate(speeds, start=1):
        assert speed <= max(0.2, 1.0 - 0.6 * 0.02 * (n - 1)) + 1e-9
    assert speeds[-1] == pytest.approx(0.2)
    assert fixture.verdict.name == "slow"
    assert fixture.text("limit") == "Slowed by lidar: person at 2 m."
    assert fixture.published().limits.forward == pytest.approx(0.2)
    (source,) = fixture.published().limit_sources
    assert (source.effect, source.linear, source.reason) == ("slow", 0.2, "person at 2 m")
    assert fixture.published().text.startswith("Slowed by lidar: person at 2 m.")
    fixture.drive(1.0, seconds=3.0)  # without limits: ignored
    assert fixture.verdict.twist.linear == pytest.approx(1.0)
    assert "limit" not in fixture.state.latches


def test_a_protective_stop_ends_by_itself_and_then_needs_a_neutral_request() -> None:
    fixture = PolicyFixture(IGNORED).running()
    verdict = fixture.limit(0.0, reason="person at 1 m")
    assert (verdict.command, verdict.name, verdict.twist) == ("stop", "stop", STILL)
    assert fixture.published().latched == ()
    for _ in range(20):
        fixture.drive(0.5, seconds=0.1)
        assert fixture.limit(0.0).command == "stop"
    fixture.limit()
    fixture.drive(0.5, seconds=1.0)
    assert fixture.verdict.name == "inhibited"  # the stick is still pushed
    fixture.drive()
    assert fixture.drive(0.5).command == "run"


def test_a_protective_stop_between_two_decisions_wants_a_neutral_request() -> None:
    fixture = PolicyFixture(IGNORED).running()
    for cap in (0.0, None):
        fixture.limit_seq += 1
        limit = Limit(linear=cap, echo=fixture.echo, seq=fixture.limit_seq, boot=55)
        request = LimitRequest("lidar", limit, fixture.now_ns)
        fixture.state, refused = fixture.policy.accept(fixture.state, request, fixture.now_ns)
        assert refused == ""
    assert fixture.drive(0.5).name == "inhibited"
    fixture.drive()
    assert fixture.drive(0.5).command == "run"


def test_a_needed_source_stops_from_the_start_until_its_first_limit() -> None:
    fixture = PolicyFixture(NEEDED)
    fixture.tick(40)
    fixture.drive(0.0, seconds=1.0)
    fixture.drive(0.5, seconds=1.0)
    assert fixture.verdict.command == "stop"
    assert (
        render(fixture.state.latches["limit_silent"].phrases)
        == "No speed limit arrives from lidar."
    )
    for _ in range(10):
        fixture.limit()
        fixture.drive(seconds=0.1)
    assert fixture.drive(0.5, seconds=0.4).command == "run"
    assert fixture.drive(0.5, seconds=0.2).command == "stop"


def test_two_limiting_publishers_stop_the_vehicle_until_one_is_left() -> None:
    fixture = PolicyFixture(IGNORED).running()
    fixture.limit(0.4)
    fixture.limit_boot = 56
    fixture.limit(1.0)
    assert fixture.refused == "limit_second_publisher"
    assert fixture.verdict.command == "stop"
    text = "Two programs send as limit lidar."
    assert render(fixture.state.latches["two_publishers"].phrases) == text
    fixture.drive(0.5, seconds=0.6)
    assert fixture.verdict.name == "inhibited"  # the stick is still pushed
    fixture.drive()
    assert fixture.drive(0.5).command == "run"


def test_a_limit_holds_for_a_release_too() -> None:
    fixture = PolicyFixture(IGNORED).running()
    fixture.pressed = True
    fixture.linear = 0.0
    fixture.let_go(60)
    fixture.linear = None
    for _ in range(10):
        fixture.tick()
        fixture.limit(0.05)
        assert fixture.hold() == ""
    assert fixture.verdict.twist.linear == pytest.approx(-0.05)
    fixture.limit(0.0, reason="person")
    assert fixture.hold() == "Stopped by lidar: person."
    assert fixture.verdict.command == "brake"
    fixture.limit()
    for _ in range(30):  # the key is still held
        fixture.tick()
        assert fixture.hold() == LET_GO
    fixture.let_go()
    assert fixture.hold() == ""


# --- emergency stops that must be kept alive ------------------------------------------------


def kept(fixture: PolicyFixture, linear: float, seconds: float) -> None:
    """Drive, with a keepalive ten times a second."""
    for _ in range(round(seconds / 0.1)):
        fixture.keepalive()
        fixture.drive(linear, seconds=0.1)


def running() -> PolicyFixture:
    fixture = PolicyFixture(KEPT)
    fixture.tick(40)
    kept(fixture, 0.0, 1.0)
    kept(fixture, 0.5, 1.0)
    assert fixture.verdict.command == "run", fixture.state.latches
    return fixture


def test_its_silence_brakes_and_latches_until_it_is_back_and_reset() -> None:
    fixture = running()
    assert fixture.drive(0.5, seconds=0.8).command == "run"
    assert fixture.drive(0.5, seconds=0.3).command == "brake"
    fixture.linear = 0.0
    fixture.tick(50)
    assert fixture.reset() == (
        "Still present: The emergency stop is no longer kept alive by pendant."
    )
    for _ in range(10):
        fixture.keepalive()
        fixture.tick(5)
    assert fixture.verdict.command == "brake"
    assert fixture.reset() == ""
    fixture.linear = None
    kept(fixture, 0.5, 0.4)
    assert fixture.verdict.command == "stop"
    kept(fixture, 0.0, 0.8)
    kept(fixture, 0.5, 0.3)
    assert fixture.verdict.command == "run"


def test_a_keepalive_may_echo_an_older_heartbeat_than_a_request_to_move() -> None:
    fixture = running()
    echo = fixture.echo
    kept(fixture, 0.5, 0.7)
    fixture.request(echo=echo)
    assert fixture.refused == "late"
    fixture.keepalive(echo=echo)
    assert fixture.refused == ""


def test_a_limit_is_as_old_as_a_request_at_most_whatever_its_lease() -> None:
    fixture = PolicyFixture(IGNORED).running()
    echo = fixture.echo
    fixture.drive(0.5, seconds=0.45)  # shorter than the lease
    fixture.limit(0.0, echo=echo)
    assert fixture.refused == "limit_late"
    fixture.limit(0.0)
    assert fixture.refused == ""


def test_messages_that_a_proxy_holds_do_not_keep_it_alive() -> None:
    fixture = running()
    echo = fixture.echo
    for _ in range(12):
        fixture.keepalive(echo=echo)
        fixture.drive(0.5, seconds=0.1)
    assert fixture.verdict.command == "brake"
    fixture.keepalive(echo=echo)
    assert fixture.refused == "limit_late"
