"""The ``t2`` command: its subcommands with their modules, by group.

A command's module has ``add_arguments(parser)`` and ``run(options) -> int``. Only the module of the
given command is imported, so that ``t2`` starts fast.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from typing import NoReturn

from common.cli_args import VERSION, run_program

GROUPS = {
    "Run": {
        "up": ("cli.run.up", "the whole stack with a simulated vehicle, until Ctrl-C"),
        "demo": ("cli.demo.command", "a simulated T2 drives a lap through the real services"),
        "drive": ("services.teleop.__main__", "drive from this terminal, by keys or gamepad"),
        "dashboard": ("services.dashboard.__main__", "show, drive and stop the robot in a browser"),
        "camera": ("services.camera.__main__", "publish the pictures of a camera on the robot"),
        "estop": ("cli.inspect.estop", "emergency stop: a robot, a site or all, until a reset"),
        "router": ("cli.run.router", "the embedded Zenoh router alone"),
        "sim": ("sim.__main__", "the simulated vehicle alone"),
        "ros2": ("services.ros2.__main__", "the gateway to ROS 2: topics, services and cmd_vel"),
    },
    "Patrol": {
        "routes": ("cli.patrol.routes", "teach, show, change and delete routes"),
        "rounds": ("cli.patrol.rounds", "start and end rounds on routes; their list and reports"),
    },
    "Inspect": {
        "doctor": ("cli.inspect.doctor", "diagnose the path from this laptop to the wheels"),
        "robots": ("cli.inspect.robots", "the robots on the bus: verdict, driver, reason"),
        "health": ("cli.inspect.health", "service health"),
        "ls": ("cli.inspect.ls", "active keys with type, rate and publishers; the services"),
        "echo": ("cli.inspect.echo", "print messages received on a key"),
        "hz": ("cli.inspect.hz", "rate, gaps, losses, bandwidth and delay of keys"),
        "call": ("cli.inspect.call", "call a service, such as safety/reset"),
    },
    "Record": {
        "record": (
            "services.recorder.__main__",
            "record everything on the bus to files, until Ctrl-C",
        ),
        "log": ("cli.recordings.log", "stops, take-overs, resets and rounds, with names"),
        "info": ("cli.recordings.info", "show the content of a recording"),
        "why": ("cli.recordings.why", "why safety stopped: its decisions again, from a recording"),
        "replay": ("cli.recordings.replay", "play a recording onto the bus"),
        "report": (
            "cli.recordings.report",
            "HTML report of a recording: path, speeds, stops, streams",
        ),
        "foxglove": ("cli.recordings.foxglove", "stream the bus live to Foxglove or Lichtblick"),
        "metrics": (
            "services.metrics.__main__",
            "export health, link, safety and odometry to Prometheus",
        ),
    },
    "Commission": {
        "checkout": ("cli.commission.command", "check the real vehicle before its first drive"),
        "fit": ("cli.fit.command", "measure a vehicle in recordings, and propose its settings"),
        "wire": ("cli.wire", "decode captured frames"),
    },
    "Administer": {
        "config": ("cli.settings", "show the effective configuration and the source of each value"),
        "install": ("cli.run.install", "install the services as systemd units on this computer"),
        "keys": ("cli.keys.command", "create, renew, revoke and list certificates"),
    },
}
COMMANDS = {name: text for group in GROUPS.values() for name, (_, text) in group.items()}
PLACES = {name: place for group in GROUPS.values() for name, (place, _) in group.items()}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code."""
    name, *words = list(sys.argv[1:] if argv is None else argv) or ["--help"]
    if name not in COMMANDS:
        refuse(name)
    module = import_module(PLACES[name])
    try:
        code = run_program(f"t2 {name}", module.add_arguments, module.run, words, COMMANDS[name])
        sys.stdout.flush()
    except KeyboardInterrupt:  # before or after the command's own handling of Ctrl-C
        return 128 + signal.SIGINT
    except BrokenPipeError:  # the reader has closed the pipe, as `| head` does
        # Otherwise Python flushes the rest to the pipe again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


def refuse(word: str) -> NoReturn:
    """Show help or version, or suggest a command, and exit."""
    parser = argparse.ArgumentParser(
        prog="t2",
        usage="t2 COMMAND [OPTIONS]",
        description="The drive stack of the T2 robot.",
        epilog=overview(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"t2 {VERSION}")
    if word in ("-h", "--help", "--version"):
        parser.parse_args([word])
    if word.startswith("-"):
        parser.error(f"{word}: options follow the command, as in: t2 COMMAND {word}")
    near = get_close_matches(word, COMMANDS, n=1)
    hint = f'did you mean "t2 {near[0]}"?' if near else '"t2 --help" lists the commands'
    parser.error(f"unknown command {word!r}; {hint}")


def overview() -> str:
    """Return the list of commands by group."""
    width = max(map(len, COMMANDS)) + 2
    lines: list[str] = []
    for title, commands in GROUPS.items():
        lines += [f"{title}:", *(f"  {name:{width}}{COMMANDS[name]}" for name in commands), ""]
    return "\n".join([*lines, '"t2 COMMAND --help" shows the options of a command.'])


if __name__ == "__main__":
    sys.exit(main())
