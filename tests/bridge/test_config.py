"""Settings: the file is the defaults, and a protection is not taken away by accident."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from common.settings import Board, BusSettings
from services.bridge.config import Bridge, BridgeConfig


def read(*sets: str) -> BridgeConfig:
    return load(BridgeConfig, Sources(environ={}, sets=sets)).config


def test_the_file_holds_the_defaults() -> None:
    config = read()
    assert (config.bridge, config.board, config.bus) == (Bridge(), Board(), BusSettings())


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


@pytest.mark.parametrize("path", ["bridge.max_linear", "bridge.max_angular", "bus.lease"])
def test_a_stricter_limit_wants_no_word(path: str) -> None:
    read(f"{path}=0.25" if path == "bus.lease" else f"{path}=0.1")


@pytest.mark.parametrize("section", ["bridge", "board", "bus"])
def test_only_protections_can_be_given_up(section: str) -> None:
    with pytest.raises(ConfigError, match="unsafe_overrides names 'port'"):
        read(f"{section}.unsafe_overrides=port")
