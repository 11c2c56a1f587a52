"""The exporter's settings."""

from typing import Annotated

from msgspec import Meta

from common import settings

# One chunk of a key expression: an id, `*`, or an id with `$*` as a wildcard within it.
ROBOTS = r"^(|\*|(\$\*)?[A-Za-z0-9_.-]+(\$\*[A-Za-z0-9_.-]+)*(\$\*)?)\Z"


class Metrics(settings.Section, frozen=True, kw_only=True):
    """Where the exporter listens on this machine, and which robots it exports."""

    port: settings.Port = 9317  # of 127.0.0.1
    robots: Annotated[str, Meta(pattern=ROBOTS)] = ""  # "berlin-$*", "*"; empty: robot.id alone


class MetricsConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the exporter uses."""

    metrics: Metrics = Metrics()
