"""What a browser may say, as tagged JSON; what is not one of these is refused.

``n`` is the number of the snapshot that a message answers: see ``driver_lock.py`` for a hold and
``snapshot_log.py`` for a reset or a switch.
"""

from typing import Annotated

from msgspec import Meta, Struct

from common.messages import Direction, LedRequest, SwitchesRequest
from services.dashboard.config import GEARS

ROBOT = r"^[A-Za-z0-9_.-]{1,64}\Z"
ROBOT_OR_NONE = r"^[A-Za-z0-9_.-]{0,64}\Z"


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
    """The controls that are held, in answer to picture ``n``; x is forward, y counter-clockwise.

    With ``release`` the vehicle moves slowly off a pressed bumper instead, in that direction.
    """

    n: int
    x: float = 0.0
    y: float = 0.0
    release: Direction | None = None


class Free(Word, frozen=True):
    """The hand is off."""


class Gear(Word, frozen=True):
    """Change the gear."""

    gear: Annotated[int, Meta(ge=1, le=GEARS)]


class Estop(Word, frozen=True):
    """Stop a robot, and latch it; any viewer may. Without a robot: the one that is looked at."""

    robot: Annotated[str, Meta(pattern=ROBOT_OR_NONE)] = ""


class Reset(Word, frozen=True):
    """Request a reset of the causes that are latched in picture ``n``."""

    n: int = 0  # not the number of a picture


class Switch(Word, frozen=True):
    """Set the board's emergency brakes, as an operator who saw picture ``n``."""

    to: SwitchesRequest
    n: int = 0


class Lamp(Word, frozen=True):
    """Set one lamp channel."""

    to: LedRequest


AnyWord = Look | Take | Leave | Hold | Free | Gear | Estop | Reset | Switch | Lamp
