"""Teleop's settings: the shipped file and what is refused."""

from typing import Any

import msgspec
import pytest

from services.teleop.config import Teleop


@pytest.mark.parametrize(
    "settings",
    [
        {"source": "Tele op"},
        {"gears_linear": [0.2, 0.3]},
        {"gears_angular": [0.5, 0.4, 0.6, 0.7, 0.8]},
        {"gears_linear": [0.0, 0.3, 0.4, 0.5, 0.6]},
        {"hold": 0.5, "hold_first": 0.4},
        {"hold": 2.0},
        {"linear_axis": 3},
        {"round_trip": 0.0},
        {"round_trip": 0.31},
        {"round_trip": float("nan")},
        {"round_trip": float("inf"), "unsafe_overrides": ["round_trip"]},
        {"gamepad_silence": 0.0},
        {"gamepad_silence": 3.5},
        {"gamepad_silence": 3.5, "unsafe_overrides": ["round_trip"]},
        {"unsafe_overrides": ["hold"]},
    ],
)
def test_a_bad_setting_is_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(settings, Teleop)
