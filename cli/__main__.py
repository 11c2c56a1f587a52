"""The ``t2`` command: each subcommand is a module of its name, or the one that ``PLACES`` names.

Such a module has ``add_arguments(parser)`` and ``run(options) -> int``. Only the module of the
given command is imported, so that ``t2`` starts fast.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from typing import Any, NoReturn

from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.errors import ConfigError, LinkError, RobotError
from common.version import VERSION

GROUPS = {
    "Run": {
        "up": "the whole stack with a simulated vehicle, until Ctrl-C",
        "demo": "a simulated T2 drives a lap through the real services",
        "drive": "drive from this terminal, by keys or gamepad",
        "dashboard": "show, drive and stop the robot in a browser",
        "estop": "emergency stop: a robot, a site or all, until a reset",
        "router": "the embedded Zenoh router alone",
        "sim": "the simulated vehicle alone",
    },
    "Inspect": {
        "doctor": "diagnose the path from this laptop to the wheels",
        "robots": "the robots on the bus: verdict, speed, driver",
        "services": "the services on the bus, with publishers and readers of each key",
        "health": "service health",
        "ls": "the keys that are alive: type, rate, publisher",
        "list": "the same as ls",
        "echo": "print messages received on a key",
        "hz": "rate, gaps and losses of a key",
        "delay": "transport delay of the messages on a key",
        "bw": "bandwidth of a key",
        "pub": "publish on a key of your own",
        "call": "call a service, such as safety/reset",
        "latency": "reaction times of the bridge, hop by hop",
        "topic": "as ros2 topic: list, echo, hz, delay, bw, info, pub",
        "schema": "the fields of a message type",
    },
    "Record": {
        "record": "record everything on the bus to files, until Ctrl-C",
        "info": "show the content of a recording",
        "replay": "play a recording onto the bus, or its raw frames to a bridge",
        "report": "HTML report of a recording: path, speeds, stops, streams",
        "foxglove": "stream the bus live to Foxglove or Lichtblick",
        "metrics": "export health, link, safety and odometry to Prometheus",
    },
    "Commission": {
        "checkout": "check the real vehicle before its first drive",
        "wire": "decode captured frames",
    },
    "Administer": {
        "config": "show the effective configuration and the source of each value",
        "install": "install the services as systemd units on this computer",
        "keys": "create, renew, revoke and list certificates",
        "completion": "print the shell completion for bash, zsh or fish",
    },
}
COMMANDS = {name: text for group in GROUPS.values() for name, text in group.items()}
INSPECT = (
    "doctor", "ls", "echo", "hz", "delay", "bw", "pub", "call", "estop", "robots", "services",
    "health", "schema", "topic", "completion",
)  # fmt: skip
PLACES = {
    "checkout": "commission.command",
    "config": "settings",
    "dashboard": "run.services:dashboard",
    "demo": "demo.command",
    "drive": "run.services:drive",
    "foxglove": "recordings.foxglove",
    "info": "recordings.info",
    "install": "run.install",
    "keys": "keys.command",
    "list": "inspect.ls",
    "metrics": "run.services:metrics",
    "record": "run.services:record",
    "replay": "recordings.replay.command",
    "report": "recordings.report.command",
    "router": "run.router",
    "sim": "run.services:sim",
    "up": "run.up",
    "wire": "wire.command",
} | {name: f"inspect.{name}" for name in INSPECT}
EXIT_CODES = {ConfigError: EXIT_CONFIG, LinkError: EXIT_LINK}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words:
        words = ["--help"]
    options = parsed(words)
    try:
        code: int = module(options.command).run(options)
        sys.stdout.flush()
    except RobotError as error:
        print(f"t2 {options.command}: {error}", file=sys.stderr)
        return EXIT_CODES.get(type(error), 1)
    except KeyboardInterrupt:  # before or after the command's own handling of Ctrl-C
        return 128 + signal.SIGINT
    except BrokenPipeError:  # the reader has closed the pipe, as `| head` does
        # Otherwise Python flushes the rest to the pipe again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """Return the parsed options; exit with usage and code 2 if they are invalid."""
    parser = argparse.ArgumentParser(
        prog="t2",
        usage="t2 COMMAND [OPTIONS]",
        description="The drive stack of the T2 robot.",
        epilog=overview(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"t2 {VERSION}")
    # Listed by the overview: argparse has no groups of commands.
    subparsers = parser.add_subparsers(
        prog="t2", dest="command", metavar="COMMAND", help=argparse.SUPPRESS
    )
    named = words[0]
    if named not in COMMANDS:
        refuse(parser, words)
    subparser = subparsers.add_parser(named, description=COMMANDS[named])
    module(named).add_arguments(subparser)
    options, unknown = parser.parse_known_args(words)
    if unknown:
        subparser.error(f"unrecognized arguments: {' '.join(unknown)}")
    return options


def refuse(parser: argparse.ArgumentParser, words: Sequence[str]) -> NoReturn:
    """Show help or version, or suggest a command, and exit."""
    first = words[0]
    if first in ("-h", "--help", "--version"):
        parser.parse_args(words[:1])
    if first.startswith("-"):
        parser.error(f"{first}: options follow the command, as in: t2 COMMAND {first}")
    near = get_close_matches(first, COMMANDS, n=1)
    hint = f'did you mean "t2 {near[0]}"?' if near else '"t2 --help" lists the commands'
    parser.error(f"unknown command {first!r}; {hint}")


def overview() -> str:
    """Return the list of commands by group."""
    width = max(map(len, COMMANDS)) + 2
    lines: list[str] = []
    for title, commands in GROUPS.items():
        lines += [f"{title}:", *(f"  {name:{width}}{text}" for name, text in commands.items()), ""]
    return "\n".join([*lines, '"t2 COMMAND --help" shows the options of a command.'])


def module(name: str) -> Any:
    """Import the module of a command, or return the ``ServiceCommand`` that stands for it."""
    path, _, function = PLACES.get(name, name).partition(":")
    found = import_module(f"cli.{path}")
    return getattr(found, function)() if function else found


if __name__ == "__main__":
    sys.exit(main())
