"""systemd's end of the socket that a service reports to."""

import contextlib
import os
import socket

PATIENCE_US = 200_000


class Manager:
    """Keeps what it was told."""

    def __init__(self, name: str) -> None:
        self.told: list[str] = []
        self._sock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._sock.bind(name.replace("@", "\0"))
        self._sock.setblocking(False)
        self.environ = {
            "NOTIFY_SOCKET": name,
            "WATCHDOG_USEC": str(PATIENCE_US),
            "WATCHDOG_PID": str(os.getpid()),
        }

    def hear(self) -> list[str]:
        """Return all that it was told up to now."""
        with contextlib.suppress(BlockingIOError):
            while True:
                self.told.append(self._sock.recv(4096).decode())
        return self.told

    def beats(self) -> int:
        """Return how many beats it has heard."""
        return self.hear().count("WATCHDOG=1")

    def close(self) -> None:
        self._sock.close()
