"""Entry point of the camera: ``python -m services.camera``, and ``t2 camera``."""

import argparse
import sys

from common.cli_args import add_setting, add_sources, run_program, sources
from common.service import run_optional_service
from services.camera.config import CameraConfig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command line options; each sets a setting."""
    parser.add_argument(
        "source", nargs="?", metavar="SOURCE",
        help="/dev/video0, rtsp://HOST/PATH, http://HOST/PATH or a file; camera.source by default",
    )  # fmt: skip
    add_setting(parser, "--name", "camera.name", "name of the camera, such as front")
    add_setting(parser, "--robot", "robot.id", "which robot, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Publish pictures until SIGINT or SIGTERM; return the exit code."""
    if options.source is not None:
        options.sets = [*options.sets, f"camera.source={options.source}"]
    return run_optional_service(
        "camera", CameraConfig, "services.camera.camera.CameraService", sources(options),
        extra="camera",
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(run_program("camera", add_arguments, run, None))
