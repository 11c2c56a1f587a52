"""systemd notifications of a ``Type=notify`` service, by datagrams to its socket.

READY once the service is up, WATCHDOG while its loop works (without them for ``WatchdogSec``,
systemd kills and restarts it), STOPPING on exit. Without systemd nothing is sent.
"""

import contextlib
import os
import socket
from collections.abc import MutableMapping

BEATS_PER_TIMEOUT = 4  # per watchdog timeout
CHECK_PERIOD_S = 0.1  # period of the timer that sends due beats


class Systemd:
    """Notifications to systemd, if it started this process; never blocks or raises."""

    def __init__(self, environ: MutableMapping[str, str] = os.environ) -> None:
        """Remove systemd's variables from the environment: children must not notify."""
        name = environ.pop("NOTIFY_SOCKET", "")
        timeout_us = environ.pop("WATCHDOG_USEC", "")
        ours = environ.pop("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        self._address = name.replace("@", "\0", 1) if name.startswith("@") else name
        self._period_ns = 0
        if ours and timeout_us.isdigit():
            self._period_ns = int(timeout_us) * 1000 // BEATS_PER_TIMEOUT
        self._due_ns = 0
        self._ready = False

    @property
    def enabled(self) -> bool:
        """Whether systemd expects notifications."""
        return bool(self._address)

    def ready(self, now_ns: int) -> None:
        """Send READY until it was delivered once; and a beat if due."""
        if not self._ready:
            self._ready = self._notify("READY=1")
        self.beat(now_ns)

    def beat(self, now_ns: int) -> None:
        """Send WATCHDOG if due; may be called at any rate."""
        if self._period_ns and now_ns >= self._due_ns:
            self._due_ns = now_ns + self._period_ns
            self._notify("WATCHDOG=1")

    def stopping(self) -> None:
        """Send STOPPING."""
        self._notify("STOPPING=1")

    def _notify(self, text: str) -> bool:
        if not self._address:
            return False
        # A full queue or a closed socket must not block the control chain.
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock,
        ):
            sock.setblocking(False)
            return bool(sock.sendto(text.encode(), self._address))
        return False
