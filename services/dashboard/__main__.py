"""Entry point of the dashboard: ``python -m services.dashboard`` and ``t2 dashboard``."""

import argparse
import sys
from collections.abc import Sequence

from common.cli_args import (
    add_setting,
    add_sources,
    needs_extra,
    run_program,
    source_words,
    sources,
)
from common.config import load
from services.dashboard.config import DashboardConfig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command line options; each sets a setting."""
    text = "address to listen on; 0.0.0.0 for the whole network"
    add_setting(parser, "--host", "dashboard.host", text)
    add_setting(parser, "--port", "dashboard.port", "port to listen on")
    add_setting(parser, "--robot", "robot.id", "robot to show first, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM; raise ``T2Error`` if the dashboard cannot start."""
    loaded = load(DashboardConfig, sources(options))
    with needs_extra("dashboard", "the page"):
        from services.dashboard.host import Host
    return Host(loaded, source_words(options)).run()


def main(argv: Sequence[str] | None = None) -> int:
    """Serve with these arguments; return the exit code, as for every service."""
    return run_program("dashboard", add_arguments, run, argv)


if __name__ == "__main__":
    sys.exit(main())
