"""The exporter's beginning: its library is an extra, and it stands behind all others."""

from collections.abc import Callable, Sequence

from common.service import Node, run_optional_service
from services.metrics.config import MetricsConfig


def main(argv: Sequence[str] | None = None) -> int:
    """Export until it is told to stop; return the exit code."""
    return run_optional_service("metrics", MetricsConfig, _exporter, argv, extra="metrics")


def _exporter() -> Callable[[Node[MetricsConfig]], object]:
    from services.metrics.exporter import Exporter

    return Exporter
