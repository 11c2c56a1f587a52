"""``t2 replay``: play a recording onto the bus, or its raw frames to a bridge."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

from cli.inspect.addressing import chunks
from cli.inspect.shell import add_options, positive, quietly, seated
from cli.recordings.info import open_recording
from cli.recordings.replay.plan import Selection
from cli.recordings.replay.targets import BoardTarget, BusTarget, SimulatorTarget, Target
from common.bus.probe import intersects, valid
from common.cli_args import sources
from common.config import load
from common.freshness import NS_PER_S
from services.bridge.config import BridgeConfig

CHECK_S = 1.0  # between two checks of the target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("file", metavar="FILE", type=Path)
    for name, text in (("--only", "these keys, such as tel/odom/odometry or 'tel/**'"),
                       ("--skip", "not these keys")):  # fmt: skip
        parser.add_argument(
            name, metavar="KEY", action="append", default=[], type=key_expression,
            help=f"{text}; may be repeated",
        )  # fmt: skip
    parser.add_argument(
        "--rate", "-r", type=positive, default=1.0, help="playback speed, 2 is twice as fast"
    )
    parser.add_argument(
        "--from", dest="begin", type=seconds, default=0.0, metavar="S", help="start at this second"
    )
    parser.add_argument(
        "--to", dest="end", type=seconds, default=None, metavar="S", help="stop at this second"
    )
    target = parser.add_mutually_exclusive_group()
    target.add_argument(
        "--simulator", action="store_true",
        help="send the recorded drive requests to a simulated vehicle; refused for a real one",
    )  # fmt: skip
    target.add_argument(
        "--frames", action="store_true",
        help="act as the board of a bridge on this host: send it the raw frames",
    )  # fmt: skip
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Play the recording; return 1 if there was nothing to play."""
    with open_recording(options.file) as reader, open_target(options) as (target, selection):
        pacer = Pacer(options.rate, target.check)
        played, over = 0, False
        with quietly():
            for each in reader:
                path = chunks(each.key)[1]
                over = selection.is_over(each.log_ns)
                if over:
                    break
                if selection.includes(path, each.log_ns):
                    pacer.wait(each.log_ns)
                    played += target.play(path, each.sample)
    if reader.cut and not over:
        print("t2 replay: the recording is truncated; played what is readable", file=sys.stderr)
    print(f"played {played} messages", file=sys.stderr)
    return 0 if played else 1


@contextmanager
def open_target(options: argparse.Namespace) -> Iterator[tuple[Target, Selection]]:
    """Yield the target and the selection of messages."""
    select = partial(
        Selection,
        matches=intersects,
        only=options.only,
        skip=options.skip,
        from_s=options.begin,
        to_s=options.end,
    )
    with ExitStack() as stack:
        if options.frames:
            board = load(BridgeConfig, sources(options)).config.board
            yield stack.enter_context(BoardTarget(board)), select("board")
            return
        seat = stack.enter_context(seated(options))
        if options.simulator:
            yield SimulatorTarget(seat, seat.robot), select("simulator")
        else:
            bus = BusTarget(seat, seat.robot)
            yield bus, select("bus", alive=bus.alive())


class Pacer:
    """Reproduces the timing of a recording at a given rate.

    It calls ``check`` while it waits, and at least once a second.
    """

    def __init__(self, rate: float, check: Callable[[], None]) -> None:
        self._rate = rate
        self._check = check
        self._checked_s = time.monotonic()
        self._start: tuple[float, int] | None = None  # our clock, the recording's clock

    def wait(self, log_ns: int) -> None:
        """Wait until a message with this log time is due."""
        if self._start is None:
            self._start = time.monotonic(), log_ns
        start_s, start_ns = self._start
        due_s = start_s + (log_ns - start_ns) / NS_PER_S / self._rate
        while True:
            now_s = time.monotonic()
            if now_s - self._checked_s >= CHECK_S:
                self._checked_s = now_s
                self._check()
            if now_s >= due_s:
                return
            time.sleep(min(due_s - now_s, CHECK_S))


def key_expression(word: str) -> str:
    """Parse a key or key expression below the robot."""
    path = word.strip("/")
    if not path or not valid(path):
        raise argparse.ArgumentTypeError(
            f"{word!r} is not a key; `t2 info FILE` lists the keys of a recording"
        )
    return path


def seconds(text: str) -> float:
    """Parse a time since the start of the recording."""
    number = float(text)
    if not 0 <= number < 1e9:
        raise ValueError(text)
    return number
