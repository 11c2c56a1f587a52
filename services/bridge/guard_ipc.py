"""What the guard hands down to the bridge: its sockets, and the pipe that the bridge feeds.

A byte on the pipe is a heartbeat of the bridge's working loop; its value is the index of the port
that commands leave from. The pipe's end is the bridge's last word, or its death.
"""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress

from msgspec import Struct

NAME = "T2_BRIDGE_HANDOVER"


class Handover(Struct, frozen=True):
    """Descriptors that a parent leaves open for its child."""

    sockets: tuple[int, ...]  # in the order of ``board.listen_ports``
    heartbeat: int  # to write to

    @property
    def descriptors(self) -> tuple[int, ...]:
        """Return all of them."""
        return *self.sockets, self.heartbeat

    def environ(self) -> dict[str, str]:
        """Return what tells the child."""
        return {NAME: ",".join(map(str, self.descriptors))}


def received(environ: Mapping[str, str]) -> Handover:
    """Return what the parent handed down; KeyError when there was no guard."""
    *sockets, heartbeat = map(int, environ[NAME].split(","))
    return Handover(tuple(sockets), heartbeat)


class Heartbeat:
    """The bridge's end of the pipe."""

    def __init__(self, descriptor: int, on_gone: Callable[[], None]) -> None:
        self._descriptor: int | None = descriptor
        self._on_gone = on_gone
        os.set_blocking(descriptor, False)

    def beat(self, port: int) -> None:
        """Say that the loop works; ``on_gone`` is called, once, when the guard has died."""
        if self._descriptor is None:
            return
        try:
            with suppress(BlockingIOError):  # the guard has enough to read
                os.write(self._descriptor, bytes((port,)))
        except OSError:
            self.end()
            self._on_gone()

    def end(self) -> None:
        """Say that no frame will follow."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
