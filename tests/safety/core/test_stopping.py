"""Standstill supervision through the whole decision."""

import pytest

from common.freshness import NS_PER_S
from t2.words import render
from tests.safety.core.policy_fixture import TICK_S, PolicyFixture


def until(fixture: PolicyFixture, command: str) -> None:
    """Advance the time until safety commands this."""
    for _ in range(200):
        if fixture.tick().command == command:
            return
    raise AssertionError(fixture.state.latches)


@pytest.mark.parametrize(("linear", "angular"), [(0.28, 0.0), (0.0, 0.49)])
def test_a_stop_that_does_not_stop_becomes_a_brake(linear: float, angular: float) -> None:
    fixture = PolicyFixture().running(linear, angular)
    fixture.linear, fixture.angular = linear, angular
    bound_s = max(linear / 0.6, angular / 1.0) + 0.5
    until(fixture, "stop")
    began_ns = fixture.now_ns
    until(fixture, "brake")
    assert fixture.now_ns - began_ns <= (bound_s + 3 * TICK_S) * NS_PER_S
    assert f"{linear:.2f} m/s" in render(fixture.state.latches["not_stopping"].phrases)
    assert fixture.tick(500).name == "brake"
    fixture.linear, fixture.angular = 0.0, 0.0
    assert fixture.drive(0.3, seconds=1.0).name == "inhibited"  # a neutral request first
    fixture.linear = fixture.angular = None
    fixture.drive()
    assert fixture.drive(0.3).command == "run"


def test_a_vehicle_that_rolled_on_is_held_by_brake_until_it_drives_again() -> None:
    fixture = PolicyFixture().running(0.28)
    fixture.linear = 0.28
    until(fixture, "brake")
    fixture.linear = 0.0
    for _ in range(200):
        assert fixture.tick().command == "brake"
    assert fixture.verdict.name == "stop"
    assert "not_stopping" not in fixture.state.latches
    fixture.linear = None
    fixture.drive()
    assert fixture.drive(0.3, seconds=1.0).command == "run"
    until(fixture, "stop")  # as before it rolled


@pytest.mark.no_cover
def test_a_slope_does_not_exhaust_the_fault_budget() -> None:
    fixture = PolicyFixture().ready()
    for _ in range(10):
        fixture.linear = None
        fixture.drive()
        fixture.drive(0.28, seconds=0.8)
        fixture.linear = 0.1
        until(fixture, "brake")
        fixture.linear = 0.0
        fixture.tick(50)
    assert "flapping" not in fixture.state.latches


@pytest.mark.parametrize(
    ("linear", "angular", "moving"),
    [
        (-4e-4, 8e-4, False),
        (6e-4, 0.0, True),
    ],
)
def test_a_request_that_the_board_gets_as_zero_commands_standstill(
    linear: float, angular: float, moving: bool
) -> None:
    fixture = PolicyFixture().ready()
    fixture.drive(seconds=1.0)
    fixture.linear = fixture.angular = 0.0
    fixture.drive(linear, angular, seconds=1.0)
    assert fixture.verdict.command == "run"
    fixture.linear = 0.09
    assert (fixture.drive(linear, angular, seconds=1.5).command == "run") is moving


def test_a_pushed_vehicle_latches_until_a_reset() -> None:
    fixture = PolicyFixture().ready()
    fixture.tick(50)
    fixture.linear = 0.3
    assert fixture.tick(20).command == "brake"
    fixture.linear = 0.0
    assert fixture.tick(100).command == "brake"
    assert fixture.reset() == ""
    assert fixture.tick(100).command == "brake"  # STOP would let it roll again
    assert fixture.verdict.name == "stop"
    fixture.linear = None
    fixture.drive()
    assert fixture.drive(0.3).command == "run"
    until(fixture, "stop")


def test_a_creep_that_only_the_counters_show_latches() -> None:
    fixture = PolicyFixture().ready()
    fixture.linear = fixture.angular = 0.0
    fixture.tick(50)
    assert "uncommanded_motion" not in fixture.state.latches
    for _ in range(10):
        fixture.distance += 0.01
        fixture.tick()
    assert "uncommanded_motion" in fixture.state.latches
