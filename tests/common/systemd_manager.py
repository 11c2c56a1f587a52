"""The notification socket of systemd."""

import contextlib
import os
import socket

PATIENCE_US = 200_000


class Manager:
    """Stores the notifications that it receives."""

    def __init__(self, name: str) -> None:
        self.messages: list[str] = []
        self._sock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._sock.bind(name.replace("@", "\0"))
        self._sock.setblocking(False)
        self.environ = {
            "NOTIFY_SOCKET": name,
            "WATCHDOG_USEC": str(PATIENCE_US),
            "WATCHDOG_PID": str(os.getpid()),
        }

    def read(self) -> list[str]:
        """Return all notifications received so far."""
        with contextlib.suppress(BlockingIOError):
            while True:
                self.messages.append(self._sock.recv(4096).decode())
        return self.messages

    def beats(self) -> int:
        """Return the number of watchdog notifications."""
        return self.read().count("WATCHDOG=1")

    def close(self) -> None:
        self._sock.close()
