"""Teleop's settings."""

from typing import Annotated

from msgspec import Meta

from common import settings
from common.settings import SourceName, allowed

Index = Annotated[int, Meta(ge=0, le=31)]  # of an axis or a button, as SDL counts them


class Teleop(settings.Section, frozen=True, kw_only=True):
    """Keyboard and gamepad; the speeds of the gears are the vehicle's."""

    source: SourceName = "teleop"  # the name to drive under; safety knows its priority
    # that a tap drives: most terminals send the first repeat after ~0.5 s
    hold_first: Annotated[float, allowed("s", ge=0.3, le=1.0)] = 0.6
    # slower: no driving keys
    round_trip: Annotated[float, allowed("s", gt=0.0, le=5.0, safe=(0.02, 0.3))] = 0.15
    gamepad: bool = True  # use the one whose deadman is held
    # of a stick's range
    deadzone: Annotated[float, allowed(ge=0.02, le=0.5)] = 0.1
    linear_axis: Index = 1  # left stick, up and down
    angular_axis: Index = 3  # right stick, left and right
    deadman_button: Index = 4  # left shoulder

    def __post_init__(self) -> None:
        if self.linear_axis == self.angular_axis:
            raise ValueError(f"linear_axis and angular_axis are both {self.linear_axis}")


class TeleopConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that teleop reads."""

    vehicle: settings.Vehicle = settings.Vehicle()
    teleop: Teleop = Teleop()
