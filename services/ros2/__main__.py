"""Entry point of the gateway to ROS 2: ``python -m services.ros2`` and ``t2 ros2``."""

import argparse
import sys

from common.cli_args import add_sources, run_program, sources
from common.service import run_optional_service
from services.ros2.config import Ros2Config


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command line options."""
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Run until SIGINT or SIGTERM; return the exit code."""
    return run_optional_service(
        "ros2", Ros2Config, "services.ros2.gateway.Gateway", sources(options), extra="ros2"
    )


if __name__ == "__main__":
    sys.exit(run_program("ros2", add_arguments, run, None))
