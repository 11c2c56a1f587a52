"""Settings: the file is the defaults, and a protection is not taken away by accident."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.bridge.config import BridgeConfig


def read(*sets: str) -> BridgeConfig:
    return load(BridgeConfig, Sources(environ={}, sets=sets)).config


@pytest.mark.parametrize(
    ("path", "good", "bad"),
    [
        ("host.stall", 0.0, 0.01),
        ("vehicle.max_linear", 1.5, 1.51),
        ("vehicle.max_angular", 2.0, 2.01),
        ("vehicle.deceleration", 0.1, 0.09),
        ("vehicle.angular_deceleration", 0.1, 0.09),
        ("board.any_source_port", "false", "true"),
        ("board.require_switches", "true", "false"),
        ("bus.lease", 2.0, 2.1),
    ],
)
def test_what_takes_a_protection_away_must_be_owned_up_to(
    path: str, good: object, bad: object
) -> None:
    read(f"{path}={good}")
    with pytest.raises(ConfigError, match=f"{path} = .* or name '{path}' in unsafe_overrides"):
        read(f"{path}={bad}")
    config = read(f"{path}={bad}", f"unsafe_overrides={path}")
    assert config.unsafe_overrides == (path,)
