"""Entry point of the Prometheus exporter: ``python -m services.metrics`` and ``t2 metrics``."""

import argparse
import sys

from common.cli_args import add_setting, add_sources, run_program, sources
from common.service import run_optional_service
from services.metrics.config import MetricsConfig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command line options; each sets a setting."""
    add_setting(
        parser,
        "--robots",
        "metrics.robots",
        "robots to export: an id, a site as 'berlin-$*', or '*' for all",
    )
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Export until SIGINT or SIGTERM; return the exit code."""
    return run_optional_service(
        "metrics",
        MetricsConfig,
        "services.metrics.exporter.Exporter",
        sources(options),
        extra="metrics",
    )


if __name__ == "__main__":
    sys.exit(run_program("metrics", add_arguments, run, None))
