"""What every program of T2 takes on its command line, and the exit codes that tell something."""

import argparse
from functools import partial
from pathlib import Path

from common.config import DEFAULT_FILE, Sources

EXIT_CONFIG = 78  # EX_CONFIG: a restart will not help
EXIT_LINK = 69  # EX_UNAVAILABLE: a port or an endpoint is taken
HOPELESS = (EXIT_CONFIG, EXIT_LINK)
WIDTH = 100  # of a service's help, in characters


def arguments(name: str) -> argparse.ArgumentParser:
    """Return the options that every service takes."""
    # A width is given: to ask the terminal for it, argparse takes 4 ms of each start (`shutil`).
    form = partial(argparse.HelpFormatter, width=WIDTH)
    parser = argparse.ArgumentParser(prog=name, formatter_class=form)
    add_sources(parser)
    return parser


def add_sources(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where settings come from."""
    parser.add_argument(
        "--config", action="append", type=Path, metavar="FILE", default=None,
        help="a TOML file over config/t2.toml; may be repeated, the later wins",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", dest="sets", metavar="PATH=VALUE", default=[],
        help="one setting, such as board.port=4002; wins over files and environment",
    )  # fmt: skip


def sources(options: argparse.Namespace) -> Sources:
    """Return where the settings come from, by the options."""
    return Sources(files=(DEFAULT_FILE, *(options.config or ())), sets=options.sets)
