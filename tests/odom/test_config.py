"""Odometry's settings: what is shipped is the default, and nonsense is refused."""

import pytest

from common.config import DEFAULT_FILE, Sources, load
from common.errors import ConfigError
from services.odom.config import OdomConfig


def loaded(*sets: str) -> OdomConfig:
    return load(OdomConfig, Sources(files=(DEFAULT_FILE,), environ={}, sets=sets)).config


@pytest.mark.parametrize(
    "bad",
    ["hold=0.0", "hold=1.0", "drift_noise=0", "gap_noise=nan", "slip_turn=9"],
)
def test_nonsense_is_refused_by_name(bad: str) -> None:
    with pytest.raises(ConfigError, match=f"odom.{bad.split('=')[0]}"):
        loaded(f"odom.{bad}")
