"""``t2 replay``: a recording onto the bus again, or its raw frames to a bridge."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

from cli.inspect.addressing import chunks
from cli.inspect.shell import add_options, positive, quietly, seated
from cli.recordings.recorded import opened
from cli.recordings.replay.pace import Pace
from cli.recordings.replay.plan import Choice
from cli.recordings.replay.targets import BoardTarget, BusTarget, SimulatorTarget, Target
from common.bus.probe import intersects, valid
from common.cli_args import sources
from common.config import load
from services.bridge.config import BridgeConfig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("file", metavar="FILE", type=Path)
    for name, text in (("--only", "these keys, such as tel/odom/odometry or 'tel/**'"),
                       ("--skip", "not these keys")):  # fmt: skip
        parser.add_argument(
            name, metavar="KEY", action="append", default=[], type=key_meant,
            help=f"{text}; may be repeated",
        )  # fmt: skip
    parser.add_argument("--rate", "-r", type=positive, default=1.0, help="2 is twice as fast")
    parser.add_argument("--from", dest="begin", type=seconds, default=0.0, metavar="S")
    parser.add_argument("--to", dest="end", type=seconds, default=None, metavar="S")
    aim = parser.add_mutually_exclusive_group()
    aim.add_argument(
        "--simulator", action="store_true",
        help="ask a simulated vehicle to move as it was asked then; refused for a real one",
    )  # fmt: skip
    aim.add_argument(
        "--frames", action="store_true",
        help="be the board of a bridge on this host: send it the raw frames",
    )  # fmt: skip
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Play it; 1 when there was nothing to play."""
    with opened(options.file) as reader, target(options) as (aim, choice):
        pace = Pace(options.rate, aim.look)
        played, over = 0, False
        with quietly():
            for each in reader:
                path = chunks(each.key)[1]
                over = choice.is_over(each.log_ns)
                if over:
                    break
                if choice.takes(path, each.log_ns):
                    pace.wait(each.log_ns)
                    played += aim.play(path, each.sample)
    if reader.cut and not over:
        print("t2 replay: the recording is cut short; all there is was played", file=sys.stderr)
    print(f"played {played} messages", file=sys.stderr)
    return 0 if played else 1


@contextmanager
def target(options: argparse.Namespace) -> Iterator[tuple[Target, Choice]]:
    """Yield where it is played to, and what of it."""
    chosen = partial(
        Choice,
        matches=intersects,
        only=options.only,
        skip=options.skip,
        from_s=options.begin,
        to_s=options.end,
    )
    with ExitStack() as stack:
        if options.frames:
            board = load(BridgeConfig, sources(options)).config.board
            yield stack.enter_context(BoardTarget(board)), chosen("board")
            return
        seat = stack.enter_context(seated(options))
        if options.simulator:
            yield SimulatorTarget(seat, seat.robot), chosen("simulator")
        else:
            bus = BusTarget(seat, seat.robot)
            yield bus, chosen("bus", alive=bus.alive())


def key_meant(word: str) -> str:
    """Read a key or key expression below the robot."""
    path = word.strip("/")
    if not path or not valid(path):
        raise argparse.ArgumentTypeError(f"{word!r} is no key; `t2 info FILE` shows what there is")
    return path


def seconds(text: str) -> float:
    """Read a time from the beginning."""
    number = float(text)
    if not 0 <= number < 1e9:
        raise ValueError(text)
    return number
