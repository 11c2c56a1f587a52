"""The dashboard's settings."""

from ipaddress import ip_address
from math import hypot
from typing import Annotated

from msgspec import Meta

from common import settings
from common.settings import SourceName

APART_PX, APART_M = 20, 0.5  # of the points of a floor plan, at least


Coordinate = Annotated[float, Meta(ge=-1e5, le=1e5)]
# A point of the floor plan: pixels from the left and from the top, and x and y in the map (m).
PlanPoint = Annotated[tuple[Coordinate, ...], Meta(max_length=4)]


class Dashboard(settings.Section, frozen=True, kw_only=True):
    """The web server, and the name that its pages drive under.

    The token is in a file and not in the settings, because the settings are published on the bus.
    """

    host: str = "127.0.0.1"  # 0.0.0.0 for the whole network, which then needs a token
    port: settings.Port = 8080
    token_file: str = ""  # one line; empty: a new token at each start, which is printed
    certificate: str = ""  # PEM files for https; both or none
    private_key: str = ""
    source: SourceName = "web"  # the name to drive under; safety knows its priority
    floor_plan: str = ""  # PNG, JPEG or WebP behind the trajectory, where localization is used
    # two of its points: pixels from the left and the top, and x and y in the map (m)
    floor_plan_first: PlanPoint = ()
    floor_plan_second: PlanPoint = ()
    # A name in safety.limits whose silence latches: an open, visible page keeps it alive.
    estop_keepalive: Annotated[str, Meta(pattern=r"^([a-z][a-z0-9_-]{0,31})?\Z")] = ""

    def __post_init__(self) -> None:
        try:
            ip_address(self.host)
        except ValueError:
            raise ValueError(f"host is {self.host!r}, allowed is an IP address") from None
        if bool(self.certificate) != bool(self.private_key):
            raise ValueError("certificate and private_key must be set together: set both or none")
        if self.floor_plan:
            check_points(self.floor_plan_first, self.floor_plan_second)
        elif self.floor_plan_first or self.floor_plan_second:
            raise ValueError("floor_plan_first and floor_plan_second need floor_plan, the image")

    @property
    def is_local(self) -> bool:
        """Whether only this host can open the page."""
        return ip_address(self.host).is_loopback


def check_points(first: PlanPoint, second: PlanPoint) -> None:
    """Raise ``ValueError`` if two points of a floor plan give no scale."""
    if not len(first) == len(second) == 4:
        raise ValueError(
            "floor_plan needs floor_plan_first and floor_plan_second, each with four numbers: "
            "pixels from the left and the top, and x and y in the map"
        )
    apart = [b - a for a, b in zip(first, second, strict=True)]
    if hypot(*apart[:2]) < APART_PX or hypot(*apart[2:]) < APART_M:
        raise ValueError(
            "floor_plan_first and floor_plan_second are too near each other: choose two points "
            f"that are at least {APART_PX} pixels and {APART_M} m apart"
        )


class DashboardConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the dashboard reads."""

    vehicle: settings.Vehicle = settings.Vehicle()
    dashboard: Dashboard = Dashboard()
