"""Ctrl-c and SIGTERM for a command that has a loop and processes to end in order."""

import contextlib
import signal
from collections.abc import Iterator

from common.loop import Loop


@contextlib.contextmanager
def interruptible(loop: Loop) -> Iterator[list[int]]:
    """Let SIGINT and SIGTERM stop the loop while the context lasts; yield those that have come."""
    came: list[int] = []

    def leave(number: int, _: object) -> None:
        came.append(number)
        loop.stop()

    before = {name: signal.signal(name, leave) for name in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield came
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
