"""Longer limits for a host with stalls; the services accept all of them."""

import pytest

from cli.demo import host_stalls
from cli.settings import Everything
from common.config import Sources, load


def limits(stall_s: float) -> Everything:
    return load(Everything, Sources(environ={}, sets=host_stalls.settings(stall_s))).config


@pytest.mark.parametrize("stall_s", [0.0, 0.02, host_stalls.LIMIT_S])
def test_short_stalls_keep_the_shipped_limits(stall_s: float) -> None:
    assert host_stalls.settings(stall_s) == []


@pytest.mark.parametrize("stall_s", [0.051, 0.1, 0.25, 0.34, 0.5, 0.7, 1.0, 1.5, 2.0, 3.3, 5.0])
def test_settings_of_every_stall_are_accepted(stall_s: float) -> None:
    config = limits(stall_s)
    assert config.safety.bumper_age == config.bridge.lease
    assert 1.0 <= config.safety.bumper_age <= 3.0
    assert 0.5 <= config.safety.react <= 1.5


def test_limits_rise_with_the_stall() -> None:
    configs = [limits(tenths / 10) for tenths in range(51)]
    for name in (*host_stalls.AGES, *host_stalls.SLOWER, "react", "runaway_time"):
        values = [getattr(config.safety, name) for config in configs]
        assert values == sorted(values), name


def test_measurement_and_warning() -> None:
    assert 0.0 <= host_stalls.measured(0.02) < 60.0
    assert "0.34 s" in host_stalls.warning(0.34)


def test_the_longest_excess_of_a_sleep_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    naps = iter([0.005, 0.305, 0.005, 1.0])

    def sleep(_: float) -> None:
        clock[0] += next(naps)

    monkeypatch.setattr("cli.demo.host_stalls.time.sleep", sleep)
    monkeypatch.setattr("cli.demo.host_stalls.time.monotonic", lambda: clock[0])
    assert host_stalls.measured(0.5) == pytest.approx(0.995)


def test_unsafe_overrides_of_host_and_caller_are_joined() -> None:
    sets = host_stalls.with_accepted_joined(
        [
            "safety.unsafe_overrides=linear_acceleration",
            "safety.linear_acceleration=5",
            *host_stalls.settings(0.5),
        ]
    )
    safety = load(Everything, Sources(environ={}, sets=sets)).config.safety
    assert safety.linear_acceleration == 5
    assert {"linear_acceleration", *host_stalls.AGES} <= set(safety.unsafe_overrides)
