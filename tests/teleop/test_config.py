"""Teleop's settings: the shipped file and what is refused."""

from typing import Any

import msgspec
import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.teleop.config import Teleop, TeleopConfig


@pytest.mark.parametrize(
    "settings",
    [
        {"source": "Tele op"},
        {"hold_first": 0.2},
        {"hold_first": 2.0},
        {"linear_axis": 3},
        {"round_trip": 0.0},
        {"round_trip": float("nan")},
        {"round_trip": float("inf")},
    ],
)
def test_a_bad_setting_is_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(settings, Teleop)


def test_a_long_round_trip_must_be_owned_up_to() -> None:
    long = "teleop.round_trip=0.31"
    with pytest.raises(ConfigError, match=r"teleop\.round_trip = 0.31 takes a protection away"):
        load(TeleopConfig, Sources(environ={}, sets=[long]))
    load(TeleopConfig, Sources(environ={}, sets=[long, "unsafe_overrides=teleop.round_trip"]))
