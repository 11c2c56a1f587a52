"""Messages from the browser, as tagged JSON; any other message is refused.

``echo`` is safety's heartbeat in the snapshot that a message answers, or in the picture by which a
driver holds. Its age is judged by safety; see ``driver_lock.py`` for a hold.
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from common.settings import GEARS
from t2.messages import CameraName, Direction, Number, RoundAction, RouteName, StationName

NAME_MAX = 40  # characters, of a viewer
ROBOT = r"^[A-Za-z0-9_.-]{1,64}\Z"


class ClientMessage(Struct, frozen=True, tag_field="k", tag=str.lower, forbid_unknown_fields=True):
    """A message from a viewer."""


class Named(ClientMessage, frozen=True, kw_only=True):
    """A message of which an event reports the sender."""

    name: Annotated[str, Meta(max_length=NAME_MAX)] = ""  # as typed on the page


class Take(Named, frozen=True):
    """Take the driver lock; with ``force`` also from another viewer."""

    force: bool = False


class Leave(ClientMessage, frozen=True):
    """Free the driver lock."""


class Hold(ClientMessage, frozen=True):
    """The held controls; x is forward, y counter-clockwise.

    With ``release`` the vehicle moves slowly off a pressed bumper instead, in this direction.
    """

    echo: int
    x: Number = 0.0
    y: Number = 0.0
    release: Direction | None = None


class Watch(ClientMessage, frozen=True):
    """The last picture is shown, or none yet: send this camera's next one."""

    camera: CameraName


class Sight(Named, frozen=True):
    """The driver sees the vehicle: holds answer snapshots, and not the pictures of a camera."""

    in_sight: bool


class Free(ClientMessage, frozen=True):
    """All controls are let go."""


class Gear(ClientMessage, frozen=True):
    """Change the gear."""

    gear: Annotated[int, Meta(ge=1, le=GEARS)]


class Alive(ClientMessage, frozen=True):
    """The page is visible: it keeps the emergency stop alive, and gets the delay of the link."""

    echo: int
    at: Number = 0.0  # the page's clock; the answer repeats it


class Estop(Named, frozen=True):
    """Emergency stop, latched, from any viewer."""

    age: Number = 0.0  # s since it was pressed


class Reset(Named, frozen=True):
    """Reset the causes that the answered snapshot shows as latched."""

    echo: int


class Round(Named, frozen=True):
    """Start a round on a route, or act on the one that is driven."""

    action: RoundAction
    echo: int
    route: RouteName | None = None  # of "start"


class Teach(Named, frozen=True):
    """Teach a route; the fields are those of ``TeachRequest``."""

    action: Literal["begin", "station", "end", "cancel"]
    echo: int
    route: RouteName | None = None
    station: StationName = ""
    stay: Annotated[float, Meta(ge=0.0, le=86_400.0)] = 0.0


class Routes(ClientMessage, frozen=True):
    """Show a route, or the list of all."""

    route: RouteName | None = None


AnyMessage = (
    Take | Leave | Hold | Free | Gear | Alive | Estop | Reset | Round | Teach | Routes
    | Watch | Sight
)  # fmt: skip
