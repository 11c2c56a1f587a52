"""The ``t2`` command: each subcommand lives in a module of its name, or a package's ``command``.

Such a module has a docstring whose first line is its help, ``add_arguments(parser)`` and
``run(options) -> int``. Only the one that is asked for is imported, so that ``t2`` starts fast.
"""

import argparse
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from common.errors import ConfigError, LinkError, RobotError
from common.options import EXIT_CONFIG, EXIT_LINK

COMMANDS = {
    "up": "router, simulated vehicle, bridge, safety and odometry, until ctrl-c",
    "demo": "a simulated T2 drives a lap through the real services",
    "soak": "lap after lap with random faults and kill -9, watching memory and more",
    "drive": "drive from this terminal, by keys or gamepad",
    "router": "the embedded Zenoh router alone",
    "sim": "the simulated vehicle alone",
    "latency": "how fast the bridge reacts, hop by hop",
    "config": "what is in force and where each value came from",
    "wire": "read captured frames",
    "checkout": "check the real vehicle before its first drive, and write a report",
}
PLACES = {"checkout": "checkout.command"}  # where it is no module of its own name
EXIT_CODES = {ConfigError: EXIT_CONFIG, LinkError: EXIT_LINK}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the subcommand that the arguments name, and return its exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    parser = argparse.ArgumentParser(prog="t2", description="The drive stack of the T2 robot.")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    named = next((word for word in words if word in COMMANDS), None)
    for name, text in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=text, description=text)
        if name == named:
            _module(name).add_arguments(subparser)
    options = parser.parse_args(words)
    try:
        code: int = _module(options.command).run(options)
    except RobotError as error:
        print(f"t2 {options.command}: {error}", file=sys.stderr)
        return EXIT_CODES.get(type(error), 1)
    except KeyboardInterrupt:  # ctrl-c while a command does not yet, or no more, see to it itself
        return 128 + signal.SIGINT
    return code


def _module(name: str) -> ModuleType:
    return import_module(f"cli.{PLACES.get(name, name)}")


if __name__ == "__main__":
    sys.exit(main())
