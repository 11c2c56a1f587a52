"""The exporter's settings."""

from ipaddress import ip_address
from typing import Annotated

from msgspec import Meta

from common import settings

# One chunk of a key expression: an id, `*`, or an id with `$*` as a wildcard within it.
ROBOTS = r"^(|\*|(\$\*)?[A-Za-z0-9_.-]+(\$\*[A-Za-z0-9_.-]+)*(\$\*)?)\Z"


class Metrics(settings.Section, frozen=True, kw_only=True):
    """Where the exporter listens, and which robots it exports."""

    unsafe_overrides: tuple[str, ...] = ()  # settings whose protection is disabled on purpose
    host: str = "127.0.0.1"  # Prometheus runs on the same machine; the bus crosses the network
    port: settings.Port = 9317
    robots: Annotated[str, Meta(pattern=ROBOTS)] = ""  # "berlin-$*", "*"; empty: robot.id alone

    def __post_init__(self) -> None:
        unknown = set(self.unsafe_overrides) - {"host"}
        if unknown:
            raise ValueError(
                f"unsafe_overrides names {min(unknown)!r}, which is not a protected setting"
            )
        try:
            local = ip_address(self.host).is_loopback
        except ValueError:
            raise ValueError(f"host is {self.host!r}, allowed is an IP address") from None
        if not local and "host" not in self.unsafe_overrides:
            raise ValueError(
                f"host {self.host} serves the network without authentication; "
                "use 127.0.0.1, or name host in unsafe_overrides"
            )


class MetricsConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the exporter uses."""

    metrics: Metrics = Metrics()
