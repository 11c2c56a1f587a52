"""Messages from the browser, as tagged JSON; any other message is refused.

``n`` is the number of the snapshot that a message answers: see ``driver_lock.py`` for a hold, a
reset or a switch.
"""

from typing import Annotated

from msgspec import Meta, Struct

from common.messages import Direction, LedRequest, SwitchesRequest
from services.dashboard.config import GEARS

ROBOT = r"^[A-Za-z0-9_.-]{1,64}\Z"
ROBOT_OR_NONE = r"^[A-Za-z0-9_.-]{0,64}\Z"


class ClientMessage(Struct, frozen=True, tag_field="k", tag=str.lower, forbid_unknown_fields=True):
    """A message from a viewer."""


class Look(ClientMessage, frozen=True):
    """Select a robot, and set the viewer's name."""

    robot: Annotated[str, Meta(pattern=ROBOT)]
    name: Annotated[str, Meta(max_length=24)] = ""


class Take(ClientMessage, frozen=True):
    """Take the driver lock; with ``force`` also from another viewer."""

    force: bool = False


class Leave(ClientMessage, frozen=True):
    """Free the driver lock."""


class Hold(ClientMessage, frozen=True):
    """The held controls, in answer to snapshot ``n``; x is forward, y counter-clockwise.

    With ``release`` the vehicle moves slowly off a pressed bumper instead, in this direction.
    """

    n: int
    x: float = 0.0
    y: float = 0.0
    release: Direction | None = None


class Free(ClientMessage, frozen=True):
    """All controls are released."""


class Gear(ClientMessage, frozen=True):
    """Change the gear."""

    gear: Annotated[int, Meta(ge=1, le=GEARS)]


class Alive(ClientMessage, frozen=True):
    """The page is visible, in answer to snapshot ``n``: it keeps the emergency stop alive."""

    n: int


class Estop(ClientMessage, frozen=True):
    """Emergency stop, latched, from any viewer; without a robot: the selected one."""

    robot: Annotated[str, Meta(pattern=ROBOT_OR_NONE)] = ""


class Reset(ClientMessage, frozen=True):
    """Reset the causes that are latched in snapshot ``n``."""

    n: int = 0  # not the number of a snapshot


class Switch(ClientMessage, frozen=True):
    """Set the board's emergency brakes, as an operator who saw snapshot ``n``."""

    to: SwitchesRequest
    n: int = 0


class Lamp(ClientMessage, frozen=True):
    """Set one lamp channel."""

    to: LedRequest


AnyMessage = Look | Take | Leave | Hold | Free | Gear | Alive | Estop | Reset | Switch | Lamp
