"""``t2 metrics``: what Prometheus asks for."""

import argparse

from cli.run.up import passed_on
from common.cli_args import add_sources
from services.metrics import __main__ as metrics


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options; all are settings."""
    parser.add_argument("--host", help="where to listen; this machine alone by default")
    parser.add_argument("--port", help="the port to listen on")
    parser.add_argument("--robots", help="of whom: an id, a site as 'berlin-$*', or '*' for all")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Answer until SIGINT or SIGTERM."""
    given = {name: getattr(options, name) for name in ("host", "port", "robots")}
    sets = [f"metrics.{name}={value}" for name, value in given.items() if value is not None]
    options.sets = [*options.sets, *sets]
    return metrics.main(passed_on(options))
