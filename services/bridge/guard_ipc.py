"""Guard-to-bridge IPC: inherited sockets, and the heartbeat pipe.

A byte on the pipe is a heartbeat of the bridge's event loop; its value is the index of the port
that commands leave from. End of file on the pipe means that the bridge exits or has died.
"""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress

from msgspec import Struct

NAME = "T2_BRIDGE_HANDOVER"


class Inherited(Struct, frozen=True):
    """File descriptors that the bridge inherits from its guard."""

    sockets: tuple[int, ...]  # in the order of ``board.listen_ports``
    heartbeat: int  # write end of the pipe

    @property
    def descriptors(self) -> tuple[int, ...]:
        """All descriptors."""
        return *self.sockets, self.heartbeat

    def environ(self) -> dict[str, str]:
        """Return the environment variable that lists them."""
        return {NAME: ",".join(map(str, self.descriptors))}


def received(environ: Mapping[str, str]) -> Inherited:
    """Read the inherited descriptors from the environment; KeyError without a guard."""
    *sockets, heartbeat = map(int, environ[NAME].split(","))
    return Inherited(tuple(sockets), heartbeat)


class Heartbeat:
    """Write end of the heartbeat pipe."""

    def __init__(self, descriptor: int, on_gone: Callable[[], None]) -> None:
        self._descriptor: int | None = descriptor
        self._on_gone = on_gone
        os.set_blocking(descriptor, False)

    def beat(self, port: int) -> None:
        """Send a heartbeat; ``on_gone`` is called once when the guard has died."""
        if self._descriptor is None:
            return
        try:
            with suppress(BlockingIOError):  # the pipe is full: the guard has heartbeats to read
                os.write(self._descriptor, bytes((port,)))
        except OSError:
            self.end()
            self._on_gone()

    def end(self) -> None:
        """Close the pipe: no frame follows."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
