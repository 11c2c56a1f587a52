"""The exporter's beginning: its library is an extra, and it stands behind all others."""

import os
import sys
from collections.abc import Sequence

from common.options import EXIT_CONFIG
from common.service import run
from services.metrics.config import MetricsConfig

NICE = 10  # whatever drives goes first
MISSING = "metrics need {}: install the extra `metrics` (pip install -e '.[metrics]')"


def main(argv: Sequence[str] | None = None) -> int:
    """Export until it is told to stop; return the exit code."""
    try:
        from services.metrics.exporter import Exporter
    except ModuleNotFoundError as error:
        print(f"metrics: {MISSING.format(error.name)}", file=sys.stderr)  # noqa: T201
        return EXIT_CONFIG
    os.nice(NICE)
    return run("metrics", MetricsConfig, Exporter, argv)
