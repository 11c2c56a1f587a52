"""What a browser may say, as tagged JSON; what is not one of these is refused.

``n`` is the number of the picture that a hold answers to, see ``wheel.py``.
"""

from typing import Annotated

from msgspec import Meta, Struct

from common.messages import LedRequest, SwitchesRequest
from services.dashboard.config import GEARS

ROBOT = r"^[A-Za-z0-9_.-]{1,64}\Z"


class Word(Struct, frozen=True, tag_field="k", tag=str.lower, forbid_unknown_fields=True):
    """One thing that a viewer says."""


class Look(Word, frozen=True):
    """Look at this robot from now on, under this name."""

    robot: Annotated[str, Meta(pattern=ROBOT)]
    name: Annotated[str, Meta(max_length=24)] = ""


class Take(Word, frozen=True):
    """Take the wheel; with force from somebody else, too."""

    force: bool = False


class Leave(Word, frozen=True):
    """Leave the wheel."""


class Hold(Word, frozen=True):
    """What the hand does, in answer to picture ``n``; x is forward, y is counter-clockwise."""

    n: int
    x: float = 0.0
    y: float = 0.0
    creep: bool = False


class Free(Word, frozen=True):
    """The hand is off."""


class Gear(Word, frozen=True):
    """Change the gear."""

    gear: Annotated[int, Meta(ge=1, le=GEARS)]


class Estop(Word, frozen=True):
    """Stop, and latch it; anybody may."""


class Reset(Word, frozen=True):
    """Ask safety to clear its latches."""


class Switch(Word, frozen=True):
    """Set the board's emergency brakes."""

    to: SwitchesRequest


class Lamp(Word, frozen=True):
    """Set one lamp channel."""

    to: LedRequest


AnyWord = Look | Take | Leave | Hold | Free | Gear | Estop | Reset | Switch | Lamp
