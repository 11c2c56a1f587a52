"""``t2 replay``: play a recording onto the bus, or its raw frames to a bridge.

Onto a bus it never plays what moves or stops the vehicle: no drive request, no motion command and
no emergency stop.
"""

import argparse
import ipaddress
import socket
import sys
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Self

from cli.inspect.addressing import EVERY_ROBOT, chunks, expression, parse_key, topic_of
from cli.inspect.estop import MOVES
from cli.inspect.session import (
    BusSession,
    add_options,
    open_session,
    positive,
    services,
    until_interrupt,
)
from cli.recordings.info import open_recording
from common import keys
from common.bus.probe import intersects
from common.cli_args import sources
from common.codec import Sample
from common.config import load
from common.errors import LinkError, RobotError
from common.freshness import NS_PER_S
from common.settings import Board
from services.bridge.config import BridgeConfig

CHECK_S = 1.0  # between two checks of the target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument(
        "--only", metavar="KEY", action="append", default=[], type=parse_key,
        help="these keys, such as odometry or 'tel/**'; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--rate", "-r", type=positive, default=1.0, help="playback speed, 2 is twice as fast"
    )
    parser.add_argument(
        "--frames", action="store_true",
        help="act as the board of a bridge on this host: send it the raw frames",
    )  # fmt: skip
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Play the recording; return 1 if there was nothing to play."""
    with open_recording(options.file) as reader, open_target(options) as target:
        pacer = Pacer(options.rate, target.check)
        played = 0
        with until_interrupt():
            for each in reader:
                if is_selected(each.key, tuple(options.only)):
                    pacer.wait(each.log_ns)
                    played += target.play(chunks(each.key)[1], each.sample)
    if reader.cut:
        print("t2 replay: the recording is truncated; played what is readable", file=sys.stderr)
    print(f"played {played} messages", file=sys.stderr)
    return 0 if played else 1


@cache
def is_selected(key: str, only: tuple[str, ...]) -> bool:
    """Return whether one of these key expressions matches; without any, all keys match."""
    return not only or any(intersects(expression(each, EVERY_ROBOT), key) for each in only)


@contextmanager
def open_target(options: argparse.Namespace) -> Iterator["BoardTarget | BusTarget"]:
    """Yield what the recording is played to."""
    if options.frames:
        with BoardTarget(load(BridgeConfig, sources(options)).config.board) as target:
            yield target
    else:
        with open_session(options) as session:
            yield BusTarget(session)


class BusTarget:
    """The keys of a robot without a running bridge or safety service."""

    def __init__(self, session: BusSession) -> None:
        """Raise ``RobotError`` if one of them is running."""
        self._probe = session.probe
        self._robot = session.robot
        self._alive = self.check()  # at the start

    def check(self) -> set[str]:
        """Return the running services; raise ``RobotError`` if bridge or safety is among them."""
        alive = {service for _, service in services(self._probe, self._robot)}
        if running := " and ".join(name for name in MOVES if name in alive):
            raise RobotError(
                f"robot {self._robot} has a running {running}: others would take replayed messages "
                "for the real ones. Stop it, or replay as another robot: --robot replay"
            )
        return alive

    def play(self, path: str, sample: Sample) -> bool:
        """Publish the original bytes, if allowed; return whether anything was sent."""
        if sample.deleted or not is_played(path, self._alive):
            return False
        key = f"{keys.ROOT}/{self._robot}/{path}"
        topic = topic_of(key)
        service = topic.service if topic else keys.SLOW
        self._probe.put(key, sample.payload, sample.encoding, service, sample.raw)
        return True


class BoardTarget:
    """A bridge on this host: receives the raw frames as if from its board."""

    def __init__(self, board: Board) -> None:
        """Raise ``RobotError`` if the board is elsewhere, ``LinkError`` if its port is taken."""
        if not ipaddress.ip_address(board.address).is_loopback:
            raise RobotError(f"--frames: the board at {board.address} is a real one")
        self._to = board.listen_address, board.listen_ports[0]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((board.address, board.port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"cannot act as the board at {board.address}:{board.port}: {error.strerror}; "
                "is a simulated one running?"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def check(self) -> None:
        """Do nothing: no condition can change."""

    def play(self, path: str, sample: Sample) -> bool:
        """Send the raw frame attached to a message; return whether there is one."""
        if sample.raw is None:
            return False
        self._socket.sendto(sample.raw, self._to)
        return True


class Pacer:
    """Reproduces the timing of a recording at a given rate.

    It calls ``check`` while it waits, and at least once a second.
    """

    def __init__(self, rate: float, check: Callable[[], object]) -> None:
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


def is_played(path: str, alive: Collection[str]) -> bool:
    """Return whether to play a key below the robot, besides these running services."""
    kind, *others = path.split("/")
    moves = path == keys.ESTOP_PATH or any(part.startswith("@") for part in (kind, *others))
    published = kind in ("tel", "evt") and others[:1] and others[0] in alive
    return not moves and not published
