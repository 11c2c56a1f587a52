"""Teleop's settings."""

from typing import Annotated, ClassVar

from msgspec import Meta

from common import settings
from common.settings import SourceName

Speed = Annotated[float, Meta(gt=0.0, le=3.0)]  # m/s or rad/s
Hold = Annotated[float, Meta(ge=0.1, le=1.0)]  # s
Index = Annotated[int, Meta(ge=0, le=31)]  # of an axis or a button, as SDL counts them
GEARS = 5


class Teleop(settings.ProtectedSection, frozen=True, kw_only=True):
    """Settings of keys, gears and gamepad; slow by default."""

    protective: ClassVar[settings.Limits] = {
        "round_trip": (0.02, 0.3),
        "gamepad_silence": (0.5, 3.0),
    }
    source: SourceName = "teleop"  # the name to drive under; safety knows its priority
    gears_linear: tuple[Speed, ...] = (0.2, 0.35, 0.5, 0.65, 0.8)  # m/s
    gears_angular: tuple[Speed, ...] = (0.3, 0.45, 0.6, 0.75, 0.9)  # rad/s
    hold_first: Hold = 0.6  # s that a tap drives: most terminals send the first repeat after ~0.5 s
    hold: Hold = 0.3  # s that a repeat drives
    round_trip: Annotated[float, Meta(gt=0.0, le=5.0)] = 0.15  # s; slower: no driving keys
    gamepad: bool = True  # use the one whose deadman is held
    gamepad_silence: Annotated[float, Meta(gt=0.0, le=60.0)] = 2.0  # s without a change
    deadzone: Annotated[float, Meta(ge=0.02, le=0.5)] = 0.1  # of a stick's range
    expo: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.5  # 0 is straight, 1 is cubic
    linear_axis: Index = 1  # left stick, up and down
    angular_axis: Index = 3  # right stick, left and right
    deadman_button: Index = 4  # left shoulder

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("gears_linear", "gears_angular"):
            gears = getattr(self, name)
            if len(gears) != GEARS or list(gears) != sorted(gears):
                raise ValueError(f"{name} {list(gears)} should be {GEARS} rising speeds")
        if self.hold > self.hold_first:
            raise ValueError(f"hold {self.hold} s must not exceed hold_first {self.hold_first} s")
        if self.linear_axis == self.angular_axis:
            raise ValueError(f"linear_axis and angular_axis are both {self.linear_axis}")


class TeleopConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that teleop reads."""

    teleop: Teleop = Teleop()
