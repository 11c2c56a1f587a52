"""Settings in recordings: which are used, and what differs from this version of T2."""

from typing import Any

import pytest

from cli.recordings.recorded_settings import Found, differing, is_known, newest, restored
from common.errors import ConfigError
from services.bridge.config import BridgeConfig
from services.safety.config import LimitSource, Safety, SafetyConfig
from t2.messages import Settings
from tests.cli.recordings.settings_fixture import message, settings_of

SECTIONS = ("host", "board", "wire", "vehicle", "safety")


def found(it: Settings, service: str = "safety", log_ns: int = 0) -> Found:
    return Found("001", service, f"a.mcap: tel/{service}/settings", log_ns, it)


def both(**others: Any) -> list[Found]:
    """Return what a robot records: the settings of bridge and safety."""
    return [
        found(settings_of(BridgeConfig()), "bridge", 1),
        found(settings_of(SafetyConfig(), **others), "safety", 2),
    ]


def test_a_configuration_is_restored_with_its_tables() -> None:
    limits = {"lidar": LimitSource(lease=0.5, silence="stop")}
    config = SafetyConfig(safety=Safety(limits=limits, react=0.3))
    chosen = restored([found(settings_of(config))], ("host", "board", "vehicle", "safety"))
    assert (chosen.config.safety, chosen.config.vehicle) == (config.safety, config.vehicle)
    assert (chosen.origin, chosen.remarks) == ("those of safety in the recording", [])


def test_options_are_on_top() -> None:
    chosen = restored(both(), SECTIONS, ["vehicle.max_linear=0.4"])
    assert chosen.config.vehicle.max_linear == 0.4
    assert (
        chosen.origin == "those of bridge, safety in the recording and --set vehicle.max_linear=0.4"
    )


def test_settings_of_another_version_are_named() -> None:
    chosen = restored(
        both(
            safety__foreign=1, radar__range=3.0, safety__sources__web__hue="x", safety__react=None
        ),
        SECTIONS,
    )
    unknown, missing = chosen.remarks
    assert unknown == (
        "ignored, unknown to this version of T2: "
        "safety.foreign, radar.range, safety.sources.web.hue"
    )
    assert missing == "not recorded, so the defaults of this version of T2: safety.react"
    assert chosen.config.safety == Safety()


def test_many_are_named_by_the_first_ones() -> None:
    (missing,) = restored([found(message({"vehicle.length": 1.2}))], SECTIONS).remarks
    assert missing.endswith("board.relay_port and 40 more"), missing


@pytest.mark.parametrize(
    ("others", "problem"),
    [
        (
            {"vehicle__max_linear": 99.0},
            "a.mcap: tel/safety/settings: vehicle.max_linear = 99.0: Expected `float` <= 3.0; "
            "allowed is 0.05..3.0 m/s",
        ),
        (
            {"safety__react": "slow"},
            "a.mcap: tel/safety/settings: safety.react = 'slow': Expected `float`, got `str`; "
            "allowed is 0.0..2.0 s",
        ),
        ({"vehicle__sonar_max": 0.6}, "a.mcap: tel/safety/settings: sonar_max 0.6 m is too near"),
        ({"safety__sources__x__priority": 3}, "safety.sources.x: needs 'lease'"),
        ({"safety__sources": 3}, "safety.sources = 3: Expected `object`, got `int`"),
    ],
)
def test_a_value_that_no_service_can_have(others: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError) as caught:
        restored(both(**others)[1:], SECTIONS)
    assert problem in str(caught.value)


def test_the_newest_of_each_service() -> None:
    old, new = message({"vehicle.length": 1.2}), message({"vehicle.length": 1.3})
    every = [found(new, "safety", 9), found(old, "safety", 1), found(old, "bridge", 5)]
    assert [(one.service, one.log_ns) for one in newest(every)] == [("bridge", 5), ("safety", 9)]
    assert restored(newest(every), SECTIONS).config.vehicle.length == 1.3
    assert differing(every, SECTIONS) == ["vehicle.length"]
    assert differing(every, ("safety",)) == differing(every[1:], SECTIONS) == []


@pytest.mark.parametrize(
    ("path", "known"),
    [
        ("vehicle.max_linear", True), ("safety.sources.new.lease", True), ("safety.limits", True),
        ("unsafe_overrides", True), ("vehicle", False), ("", False),
        ("vehicle.max_linear.x", False),
        ("safety.sources.new", False), ("safety.sources.new.hue", False), ("radar.range", False),
    ],
)  # fmt: skip
def test_paths(path: str, known: bool) -> None:
    assert is_known(path) is known


def test_every_setting_that_a_service_publishes_is_known() -> None:
    published = [*settings_of(SafetyConfig()).settings, *settings_of(BridgeConfig()).settings]
    assert [path for path in published if not is_known(path)] == []
