"""``t2 replay``: play a recording onto the bus.

It never plays what moves or stops the vehicle: no drive request, no motion command and no emergency
stop.
"""

import argparse
import sys
import time
from collections.abc import Collection
from functools import cache

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
from common.bus.inspector import intersects
from common.cli_args import file_path
from common.freshness import NS_PER_S
from t2 import keys
from t2.codec import Sample
from t2.errors import T2Error

CHECK_S = 1.0  # between two checks of the running services


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("file", metavar="FILE", type=file_path)
    parser.add_argument(
        "--only", metavar="KEY", action="append", default=[], type=parse_key,
        help="these keys, such as odometry or 'tel/**'; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--rate", "-r", type=positive, default=1.0, help="playback speed, 2 is twice as fast"
    )
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Play the recording; return 1 if there was nothing to play."""
    with open_recording(options.file) as reader, open_session(options) as session:
        player = Player(session, options.rate)
        played = 0
        with until_interrupt():
            for each in reader:
                if is_selected(each.key, tuple(options.only)):
                    player.wait(each.log_ns)
                    played += player.play(chunks(each.key)[1], each.sample)
    if reader.cut:
        print("t2 replay: the recording is truncated; played what is readable", file=sys.stderr)
    print(f"played {played} messages", file=sys.stderr)
    return 0 if played else 1


@cache
def is_selected(key: str, only: tuple[str, ...]) -> bool:
    """Return whether one of these key expressions matches; without any, all keys match."""
    return not only or any(intersects(expression(each, EVERY_ROBOT), key) for each in only)


class Player:
    """Plays messages at their pace to a robot without a running bridge or safety service."""

    def __init__(self, session: BusSession, rate: float) -> None:
        """Raise ``T2Error`` if one of them is running."""
        self._inspector, self._robot, self._rate = session.inspector, session.robot, rate
        self._start: tuple[float, int] | None = None  # our clock, the recording's clock
        self._checked_s = time.monotonic()
        self._alive = self._check()  # at the start

    def wait(self, log_ns: int) -> None:
        """Wait until a message with this log time is due; check once a second at least."""
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

    def play(self, path: str, sample: Sample) -> bool:
        """Publish the original bytes, if allowed; return whether anything was sent."""
        if sample.deleted or not is_played(path, self._alive):
            return False
        key = f"{keys.ROOT}/{self._robot}/{path}"
        topic = topic_of(key)
        service = topic.service if topic else keys.SLOW
        self._inspector.put(key, sample.payload, sample.encoding, service, sample.raw)
        return True

    def _check(self) -> set[str]:
        """Return the running services; raise ``T2Error`` if bridge or safety is among them."""
        alive = {service for _, service in services(self._inspector, self._robot)}
        if running := " and ".join(name for name in MOVES if name in alive):
            raise T2Error(
                f"robot {self._robot} has a running {running}: others would take replayed messages "
                "for the real ones. Stop it, or replay as another robot: --robot replay"
            )
        return alive


def is_played(path: str, alive: Collection[str]) -> bool:
    """Return whether to play a key below the robot, besides these running services."""
    kind, *others = path.split("/")
    moves = path == keys.ESTOP_PATH or any(part.startswith("@") for part in (kind, *others))
    published = kind in ("tel", "evt") and others[:1] and others[0] in alive
    return not moves and not published
