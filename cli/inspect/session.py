"""Options, bus session and handling of Ctrl-C that the commands share."""

import argparse
import signal
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from msgspec.structs import replace

from cli.inspect import output
from cli.inspect.addressing import EVERY_ROBOT, chunks, parse_site
from common.bus.inspector import Answer, Inspector, inspecting
from common.bus.session import operator_name
from common.cli_args import add_sources, source_words, sources
from common.config import Sources, load
from common.settings import Shared
from t2 import codec, keys
from t2.codec import Sample
from t2.errors import MessageError


@dataclass(frozen=True, slots=True)
class BusSession:
    """Bus session of a command, and its robot or a key expression for several robots."""

    inspector: Inspector
    robot: str
    user: str  # who uses this command


def add_options(parser: argparse.ArgumentParser, *, every: bool = True) -> None:
    """Add the options of every command; ``every`` allows several robots at a time."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--robot", type=str if every else one_robot, help="which robot, such as 001")
    if every:
        which.add_argument(
            "--site",
            dest="robot",
            type=parse_site,
            metavar="SITE",
            help="all robots whose id begins with SITE-, such as berlin-007 for berlin",
        )
        which.add_argument(
            "--all", dest="robot", action="store_const", const=EVERY_ROBOT, help="all robots"
        )
    parser.add_argument("--json", action="store_true", help="print JSON lines instead of text")
    add_sources(parser)


def one_robot(text: str) -> str:
    """Check the name of one robot, for commands that work on one robot at a time."""
    if "*" in text:
        raise argparse.ArgumentTypeError("this command works on one robot at a time; name it")
    return text


def add_duration(parser: argparse.ArgumentParser, default_s: float | None = None) -> None:
    """Add the option for how long a command listens."""
    text = "until Ctrl-C" if default_s is None else f"{default_s:g} s"
    parser.add_argument(
        "--duration", type=positive, default=default_s, metavar="S",
        help=f"listen for S seconds; default: {text}",
    )  # fmt: skip


def positive(text: str) -> float:
    """Parse seconds or hertz: positive and finite."""
    number = float(text)
    if not 0 < number < 1e9:
        raise argparse.ArgumentTypeError(f"{text} must be more than 0 and less than 1e9")
    return number


def robot_sources(options: argparse.Namespace) -> Sources:
    """Return the sources of settings; ``--robot`` with one name sets ``robot.id``."""
    given = sources(options)
    if options.robot and "*" not in options.robot:
        given = replace(given, sets=(*given.sets, f"robot.id={options.robot}"))
    return given


def settings(options: argparse.Namespace) -> Shared:
    """Return the effective shared settings."""
    return load(Shared, robot_sources(options)).config


@contextmanager
def open_session(options: argparse.Namespace) -> Iterator[BusSession]:
    """Open a bus session for the context; raise ``LinkError`` without a router.

    Warn of messages that were dropped because the command read too slowly.
    """
    config = settings(options)
    several = options.robot and "*" in options.robot
    with inspecting(config.bus, source_words(options)) as opened:
        robot = options.robot if several else config.robot.id
        yield BusSession(opened, robot, operator_name(config.bus))
        if opened.left_out:
            output.warn(f"t2: {opened.left_out} messages dropped, the oldest: read too slowly")


def services(opened: Inspector, robot: str, service: str = "*") -> list[tuple[str, str]]:
    """Return robot and service of each liveliness token."""
    tokens = map(chunks, opened.alive(keys.live_key(robot, service, "*")))
    return [(name, path.split("/")[1]) for name, path in tokens]


def decoded(received: Iterable[Sample | Answer], kind: type[codec.S]) -> Iterator[codec.S]:
    """Yield the valid messages; any program may publish an invalid one."""
    for each in received:
        with suppress(MessageError):
            yield codec.decode(each.payload, kind)


@contextmanager
def until_interrupt() -> Iterator[None]:
    """End the body on Ctrl-C or SIGTERM and continue after it."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        signal.signal(signal.SIGTERM, before)
