"""The dashboard's settings."""

from ipaddress import ip_address
from typing import Annotated

from msgspec import Meta

from common import settings
from common.settings import SourceName

# Its origin is part of a Content-Security-Policy: no separator of that may occur.
Url = Annotated[
    str, Meta(pattern=r"^(https?://[A-Za-z0-9._-]+(:[0-9]{1,5})?(/[^\s\"'<>;,\\]*)?)?\Z")
]


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
    # A name in safety.limits whose silence latches: an open, visible page keeps it alive.
    estop_keepalive: Annotated[str, Meta(pattern=r"^([a-z][a-z0-9_-]{0,31})?\Z")] = ""
    # The URL of an MJPEG stream; ``{robot}`` in the path is the robot's id. Empty: none.
    camera: Url = ""

    def __post_init__(self) -> None:
        try:
            ip_address(self.host)
        except ValueError:
            raise ValueError(f"host is {self.host!r}, allowed is an IP address") from None
        if bool(self.certificate) != bool(self.private_key):
            raise ValueError("certificate and private_key must be set together: set both or none")

    @property
    def is_local(self) -> bool:
        """Whether only this host can open the page."""
        return ip_address(self.host).is_loopback


class DashboardConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the dashboard reads."""

    vehicle: settings.Vehicle = settings.Vehicle()
    dashboard: Dashboard = Dashboard()
