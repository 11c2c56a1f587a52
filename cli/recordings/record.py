"""``t2 record``: everything on the bus to files, until ctrl-c."""

import argparse
from pathlib import Path

from cli.run.up import passed_on
from common.cli_args import add_sources
from services.recorder import __main__ as recorder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options; all are settings."""
    parser.add_argument("--folder", type=Path, metavar="DIR", help="where to; recorder.folder")
    parser.add_argument("--robot", help="which robot, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Record until SIGINT or SIGTERM."""
    given = {
        "recorder.everything": "true",
        "recorder.folder": options.folder,
        "robot.id": options.robot,
    }
    sets = [f"{path}={value}" for path, value in given.items() if value is not None]
    options.sets = ["recorder.make_room=false", *options.sets, *sets]
    return recorder.main(passed_on(options))
