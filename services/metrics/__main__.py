"""Entry point of the Prometheus exporter: ``python -m services.metrics``."""

import sys
from collections.abc import Callable, Sequence

from common.service import Node, run_optional_service
from services.metrics.config import MetricsConfig


def main(argv: Sequence[str] | None = None) -> int:
    """Export until SIGINT or SIGTERM; return the exit code."""
    return run_optional_service("metrics", MetricsConfig, _exporter, argv, extra="metrics")


def _exporter() -> Callable[[Node[MetricsConfig]], object]:
    from services.metrics.exporter import Exporter

    return Exporter


if __name__ == "__main__":
    sys.exit(main())
