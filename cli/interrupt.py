"""Ctrl-C and SIGTERM for commands."""

import contextlib
import signal
from collections.abc import Iterator

from common.loop import Loop


@contextlib.contextmanager
def interruptible(loop: Loop) -> Iterator[list[int]]:
    """Stop the loop on SIGINT or SIGTERM while the context lasts; yield the signals received."""
    received: list[int] = []

    def stop(number: int, _: object) -> None:
        received.append(number)
        loop.stop()

    before = {name: signal.signal(name, stop) for name in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
