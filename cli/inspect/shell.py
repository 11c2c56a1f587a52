"""What all these tools share: their options, their session, their end."""

import argparse
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from cli.inspect.addressing import EVERY_ROBOT, is_many, robots_of
from common.bus.probe import Probe, probe
from common.cli_args import add_sources, sources
from common.config import load
from common.settings import Shared


@dataclass(frozen=True, slots=True)
class Seat:
    """Where a tool sits: its session, and the robot that it looks at, or an expression for many."""

    probe: Probe
    robot: str


def add_options(parser: argparse.ArgumentParser, *, every: bool = True) -> None:
    """Add the options that every tool takes; ``every`` says whether all robots will do."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--robot", type=str if every else one_robot, help="which robot, such as 001")
    if every:
        which.add_argument(
            "--site", dest="robot", type=robots_of, help="all robots of a site, such as berlin"
        )
        which.add_argument(
            "--all", dest="robot", action="store_const", const=EVERY_ROBOT, help="all robots"
        )
    add_output(parser)
    add_sources(parser)


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add the option that chooses the form of the output; the same on a terminal and in a pipe."""
    parser.add_argument(
        "-o", "--output", choices=["text", "table", "json"], default="text",
        help="text (default), table: one line per message where text has several, json: JSON lines",
    )  # fmt: skip
    parser.add_argument(
        "--json", dest="output", action="store_const", const="json", help="the same as -o json"
    )
    parser.add_argument(
        "--text", dest="output", action="store_const", const="text", help="the same as -o text"
    )


def one_robot(text: str) -> str:
    """Read a robot's name where all of them will not do."""
    if is_many(text):
        raise argparse.ArgumentTypeError("this is for one robot at a time, name it")
    return text


def add_end(parser: argparse.ArgumentParser) -> None:
    """Add the options that end a tool by itself."""
    parser.add_argument("--duration", type=positive, metavar="S", help="end after so long")
    parser.add_argument(
        "--count", "--times", "-n", "-t", type=whole, metavar="N", help="end after so many"
    )


def positive(text: str) -> float:
    """Read seconds or hertz: more than none, and finite."""
    number = float(text)
    if not 0 < number < 1e9:
        raise argparse.ArgumentTypeError(f"{text} should be more than 0 and less than 1e9")
    return number


def whole(text: str) -> int:
    """Read a count of one or more."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} should be 1 or more")
    return number


def wants_json(options: argparse.Namespace) -> bool:
    """Return whether the output is JSON lines."""
    return bool(options.output == "json")


def settings(options: argparse.Namespace) -> Shared:
    """Return the shared settings in force; ``--robot`` names one robot there, too."""
    if options.robot and not is_many(options.robot):
        options.sets = [*options.sets, f"robot.id={options.robot}"]
    return load(Shared, sources(options)).config


@contextmanager
def seated(options: argparse.Namespace) -> Iterator[Seat]:
    """Join the bus while the context lasts; raise ``LinkError`` without a router."""
    config = settings(options)
    named = options.robot and is_many(options.robot)
    robot = options.robot if named else config.robot.id
    with probe(config.bus) as opened:
        yield Seat(opened, robot)


@contextmanager
def quietly() -> Iterator[None]:
    """Let ctrl-c or SIGTERM end what is inside, and go on behind it."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        signal.signal(signal.SIGTERM, before)
