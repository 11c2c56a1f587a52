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
        ("bridge.stall", 0.0, 0.01),
        ("bridge.max_linear", 1.5, 1.51),
        ("bridge.max_angular", 2.0, 2.01),
        ("board.any_source_port", "false", "true"),
        ("bus.lease", 2.0, 2.1),
    ],
)
def test_what_takes_a_protection_away_must_be_owned_up_to(
    path: str, good: object, bad: object
) -> None:
    section, name = path.split(".")
    read(f"{path}={good}")
    with pytest.raises(ConfigError, match=f"{section}: {name} = .* or name it in unsafe_overrides"):
        read(f"{path}={bad}")
    read(f"{path}={bad}", f"{section}.unsafe_overrides={name}")
