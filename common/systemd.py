"""What systemd wants to hear of a service of ``Type=notify``, by datagrams to its socket.

READY once the service is there, WATCHDOG while its loop works (systemd kills and restarts it when
they stay away for ``WatchdogSec``), STOPPING on its way out. Without systemd nothing is said.
"""

import contextlib
import os
import socket
from collections.abc import MutableMapping

BEATS = 4  # in the time after which systemd loses patience
OFTEN_S = 0.1  # between two looks at whether a beat is due


class Systemd:
    """The way to systemd, if it has started this process; it never waits and never fails."""

    def __init__(self, environ: MutableMapping[str, str] = os.environ) -> None:
        """Take systemd's variables out of the environment: a child of ours does not speak."""
        name = environ.pop("NOTIFY_SOCKET", "")
        patience_us = environ.pop("WATCHDOG_USEC", "")
        ours = environ.pop("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        self._address = name.replace("@", "\0", 1) if name.startswith("@") else name
        self._period_ns = 0
        if ours and patience_us.isdigit():
            self._period_ns = int(patience_us) * 1000 // BEATS
        self._due_ns = 0
        self._ready = False

    @property
    def listens(self) -> bool:
        """Whether there is anybody to tell."""
        return bool(self._address)

    def ready(self, now_ns: int) -> None:
        """Say that the service is there, until that was taken once; and beat."""
        if not self._ready:
            self._ready = self._say("READY=1")
        self.beat(now_ns)

    def beat(self, now_ns: int) -> None:
        """Say that the loop works, when it is time to; may be called as often as you like."""
        if self._period_ns and now_ns >= self._due_ns:
            self._due_ns = now_ns + self._period_ns
            self._say("WATCHDOG=1")

    def stopping(self) -> None:
        """Say that the end has begun."""
        self._say("STOPPING=1")

    def _say(self, text: str) -> bool:
        if not self._address:
            return False
        # A full queue or a socket that is gone must not hold up what drives.
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock,
        ):
            sock.setblocking(False)
            return bool(sock.sendto(text.encode(), self._address))
        return False
