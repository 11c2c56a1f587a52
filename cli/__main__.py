"""The ``t2`` command: each subcommand lives in a module of its name, or a package's ``command``.

Such a module has a docstring whose first line is its help, ``add_arguments(parser)`` and
``run(options) -> int``. Only the one that is asked for is imported, so that ``t2`` starts fast.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from common.errors import ConfigError, LinkError, RobotError
from common.options import EXIT_CONFIG, EXIT_LINK

COMMANDS = {
    "up": "router, simulated vehicle, bridge, safety, odometry and recorder, until ctrl-c",
    "demo": "a simulated T2 drives a lap through the real services",
    "soak": "lap after lap with random faults and kill -9, watching memory and more",
    "drive": "drive from this terminal, by keys or gamepad",
    "dashboard": "see it, drive it and stop it in a browser",
    "router": "the embedded Zenoh router alone",
    "sim": "the simulated vehicle alone",
    "latency": "how fast the bridge reacts, hop by hop",
    "config": "what is in force and where each value came from",
    "keys": "make, renew, revoke and list the certificates of a site",
    "wire": "read captured frames",
    "checkout": "check the real vehicle before its first drive, and write a report",
    "doctor": "find out what is wrong between this laptop and the wheels",
    "ls": "the keys that are alive: type, rate, publisher",
    "list": "the same as ls",
    "echo": "show what comes on a key",
    "hz": "how often a key comes, its gaps and losses",
    "delay": "how long messages are under way",
    "bw": "how many bytes a key takes",
    "pub": "publish on a key of your own",
    "call": "make a call to a service, such as safety/reset",
    "estop": "stop the robot now, a site's or all; they stay so until a reset",
    "robots": "the robots that are there: verdict, speed, driver",
    "services": "who is there, who publishes and who reads",
    "health": "how the services fare",
    "schema": "the fields of a message type",
    "topic": "list, echo, hz, delay, bw, info, pub: the words of ros2 topic",
    "record": "everything on the bus to files, until ctrl-c",
    "info": "what is in a recording",
    "metrics": "health, link, safety and odometry for Prometheus",
    "report": "a recording as one page: path, speeds, stops, streams",
    "replay": "a recording onto the bus again, or its frames to a bridge",
    "foxglove": "the bus, live, to Foxglove or Lichtblick",
    "install": "have systemd run the services on this computer",
    "completion": "what bash, zsh or fish want to complete t2",
}
INSPECT = (
    "doctor", "ls", "echo", "hz", "delay", "bw", "pub", "call", "estop", "robots", "services",
    "health", "schema", "topic", "completion",
)  # fmt: skip
# Where it is no module of its own name.
PLACES = {
    "checkout": "checkout.command",
    "keys": "keys.command",
    "replay": "replay.command",
    "report": "report.command",
    "list": "inspect.ls",
} | {name: f"inspect.{name}" for name in INSPECT}
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
            module(name).add_arguments(subparser)
    options = parser.parse_args(words)
    try:
        code: int = module(options.command).run(options)
        sys.stdout.flush()
    except RobotError as error:
        print(f"t2 {options.command}: {error}", file=sys.stderr)
        return EXIT_CODES.get(type(error), 1)
    except KeyboardInterrupt:  # ctrl-c while a command does not yet, or no more, see to it itself
        return 128 + signal.SIGINT
    except BrokenPipeError:  # nobody reads any more, as after `| head`
        # Python would write what is left once more on its way out.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


def module(name: str) -> ModuleType:
    """Import the module of a command."""
    return import_module(f"cli.{PLACES.get(name, name)}")


if __name__ == "__main__":
    sys.exit(main())
