"""Entry point of the recorder: ``python -m services.recorder``, and ``t2 record``."""

import argparse
import sys

from common.cli_args import add_setting, add_sources, run_program, sources
from common.service import run_optional_service
from services.recorder.config import RecorderConfig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command line options; each sets a setting."""
    add_setting(
        parser, "--folder", "recorder.folder", "folder for the files; recorder.folder by default"
    )
    add_setting(parser, "--robot", "robot.id", "which robot, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Record continuously, for ``t2 record``; remove no recordings unless an option says so."""
    options.sets = ["recorder.make_room=false", *options.sets, "recorder.everything=true"]
    return serve(options, "without_log")


def serve(options: argparse.Namespace, builder: str = "Recorder") -> int:
    """Run the black box until SIGINT or SIGTERM; return the exit code."""
    return run_optional_service(
        "recorder",
        RecorderConfig,
        f"services.recorder.recorder.{builder}",
        sources(options),
        extra="record",
    )


if __name__ == "__main__":
    sys.exit(run_program("recorder", add_arguments, serve, None))
