"""Third parties as processes: a killed limit source stops the vehicle, a killed pendant latches."""

from pathlib import Path

import pytest

from verification.faults.stack_fixture import StackFixture, stack_fixture
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed


def causes(fixture: StackFixture) -> set[str]:
    return {cause.name for cause in fixture.state.causes} if fixture.state else set()


def test_a_limit_source_that_is_killed_stops_the_vehicle(tmp_path: Path) -> None:
    with stack_fixture(tmp_path, shipped=False, need="third parties") as fixture:
        fixture.ready()
        fixture.running.kill("limiter")
        wait_until(lambda: not fixture.moving(), "a stop")
        wait_until(lambda: "limit_silent" in causes(fixture), "the cause")
        assert not fixture.latched()
        fixture.running.start("limiter")
        wait_until(lambda: "neutral" in causes(fixture), "a neutral request that is due")
        assert not fixture.moving()
        assert fixture.rearm(10.0)


def test_a_pendant_that_is_killed_latches(tmp_path: Path) -> None:
    with stack_fixture(tmp_path, shipped=False, need="third parties") as fixture:
        fixture.ready()
        fixture.running.kill("pendant")
        wait_until(lambda: not fixture.moving(), "BRAKE")
        wait_until(lambda: "estop_keepalive" in causes(fixture), "the cause")
        fixture.request(0.0)
        fixture.reset()
        assert fixture.latched()  # the pendant is still gone
        fixture.running.start("pendant")

        def is_reset() -> bool:
            fixture.reset()
            return not fixture.latched()

        wait_until(is_reset, "a reset")
        assert fixture.rearm(10.0)
