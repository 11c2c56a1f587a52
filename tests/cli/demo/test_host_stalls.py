"""Longer limits for a host with stalls; the services accept all of them."""

import msgspec
import pytest

from cli.demo import host_stalls
from cli.settings import Everything
from common.config import Sources, load


def limits(stall_s: float) -> Everything:
    return load(Everything, Sources(environ={}, sets=host_stalls.settings(stall_s))).config


@pytest.mark.parametrize("stall_s", [0.051, 0.34, 1.0, 5.0])
def test_settings_of_every_stall_are_accepted(stall_s: float) -> None:
    assert host_stalls.settings(host_stalls.LIMIT_S) == []
    config = limits(stall_s)
    assert config.safety.stall == config.bridge.stall == min(1.0, max(0.3, stall_s))


@pytest.mark.parametrize("stall_s", [0.3, 1.0])
def test_every_limit_is_longer(stall_s: float) -> None:
    safety, bridge = limits(stall_s).safety, limits(stall_s).bridge
    for times in (safety.times, bridge.times):
        assert msgspec.structs.asdict(times) == {
            name: value + 3 * stall_s
            for name, value in msgspec.structs.asdict(type(times)()).items()
        }
    assert safety.leased["nav"].lease == 0.2 + 3 * stall_s
    assert safety.reaction == 0.25 + 2 * stall_s


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
    assert set(safety.unsafe_overrides) == {"linear_acceleration", "stall"}
