"""Entry point of the dashboard: ``python -m services.dashboard`` and ``t2 dashboard``."""

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from common.cli_args import EXIT_CONFIG, EXIT_LINK, add_sources, sources
from common.config import load
from common.errors import ConfigError, LinkError, RobotError
from services.dashboard.config import DashboardConfig

if TYPE_CHECKING:
    from services.dashboard.host import Host

EXIT_CODES = {ConfigError: EXIT_CONFIG, LinkError: EXIT_LINK}
EXTRA = {"h11", "starlette", "uvicorn", "websockets"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command line options; each sets a setting."""
    parser.add_argument("--host", help="address to listen on; 0.0.0.0 for the whole network")
    parser.add_argument("--port", help="port to listen on")
    parser.add_argument("--robot", help="robot to show first, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM; raise ``RobotError`` if the dashboard cannot start."""
    for name, path in (
        ("host", "dashboard.host"),
        ("port", "dashboard.port"),
        ("robot", "robot.id"),
    ):
        if getattr(options, name) is not None:
            options.sets = [*options.sets, f"{path}={getattr(options, name)}"]
    loaded = load(DashboardConfig, sources(options))
    return _host_class()(loaded).run()


def main(argv: Sequence[str] | None = None) -> int:
    """Serve with these arguments; return the exit code, as for every service."""
    parser = argparse.ArgumentParser(prog="dashboard")
    add_arguments(parser)
    try:
        return run(parser.parse_args(argv))
    except RobotError as error:
        print(f"dashboard: {error}", file=sys.stderr)  # noqa: T201 - logs may not be set up yet
        return EXIT_CODES.get(type(error), 1)


def _host_class() -> "type[Host]":
    try:
        from services.dashboard.host import Host
    except ModuleNotFoundError as error:
        if error.name and error.name.split(".")[0] in EXTRA:
            raise RobotError(
                f"the page needs {error.name}: install the extra `dashboard` "
                "(pip install -e '.[dashboard]')"
            ) from None
        raise
    return Host


if __name__ == "__main__":
    sys.exit(main())
