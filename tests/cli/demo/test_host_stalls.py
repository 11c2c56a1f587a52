"""Longer limits for a host with stalls; the services accept all of them."""

import msgspec
import pytest

from cli.demo import host_stalls
from cli.settings import Everything
from common.config import Sources, load
from services.bridge.config import BridgeConfig
from services.safety.config import SafetyConfig


@pytest.mark.parametrize(("stall_s", "allowed_s"), [(0.051, 0.3), (0.34, 0.34), (5.0, 1.0)])
def test_every_limit_is_longer(stall_s: float, allowed_s: float) -> None:
    sets = host_stalls.settings(stall_s)
    config = load(Everything, Sources(environ={}, sets=sets)).config
    assert config.host.stall == allowed_s
    safety = SafetyConfig(host=config.host)
    for times in (safety.times, BridgeConfig(host=config.host).times):
        assert msgspec.structs.asdict(times) == {
            name: value + 3 * allowed_s
            for name, value in msgspec.structs.asdict(type(times)()).items()
        }
    assert safety.leased["nav"].lease == 0.2 + 3 * allowed_s
    assert safety.reaction == pytest.approx(0.25 + 0.02 + 2 * allowed_s)


def test_a_short_stall_changes_nothing() -> None:
    assert host_stalls.settings(host_stalls.LIMIT_S) == []


def test_the_longest_excess_of_a_sleep_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    naps = iter([0.005, 0.305, 0.005, 1.0])

    def sleep(_: float) -> None:
        clock[0] += next(naps)

    monkeypatch.setattr("cli.demo.host_stalls.time.sleep", sleep)
    monkeypatch.setattr("cli.demo.host_stalls.time.monotonic", lambda: clock[0])
    assert host_stalls.measured(0.5) == pytest.approx(0.995)


def test_unsafe_overrides_of_host_and_caller_are_joined() -> None:
    sets = host_stalls.with_overrides_joined(
        [
            "unsafe_overrides=safety.linear_acceleration",
            "safety.linear_acceleration=5",
            *host_stalls.settings(0.5),
        ]
    )
    config = load(Everything, Sources(environ={}, sets=sets)).config
    assert config.safety.linear_acceleration == 5
    wanted = {"safety.linear_acceleration", "host.stall", "bus.lease"}
    assert set(config.unsafe_overrides) == wanted
