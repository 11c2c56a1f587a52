"""A TCP proxy that can hold back what a client sends, and release it in a burst."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from typing import Self

CHUNK = 65536
HOST = "127.0.0.1"


class TcpProxy:
    """Forwards connections to a port of loopback; ``hold`` stops what the clients send.

    Connections stay open meanwhile, and what the server sends still arrives: only the way to the
    robot is held, so that neither side notices it early.
    """

    def __init__(self, port: int) -> None:
        self._target = port
        self._listener = socket.create_server((HOST, 0))
        self._flows = threading.Event()
        self._flows.set()
        self._sockets: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._flows.set()
        for sock in (self._listener, *self._sockets):
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)  # wakes the thread that waits for it
            sock.close()

    @property
    def port(self) -> int:
        """Return the port to connect to."""
        return int(self._listener.getsockname()[1])

    @contextlib.contextmanager
    def hold(self) -> Iterator[None]:
        """Hold back what the clients send; release all of it at the end of the context."""
        self._flows.clear()
        try:
            yield
        finally:
            self._flows.set()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                server = socket.create_connection((HOST, self._target))
                for sock in (client, server):
                    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._sockets += [client, server]
                for pair in ((client, server, True), (server, client, False)):
                    threading.Thread(target=self._forward, args=pair, daemon=True).start()

    def _forward(self, source: socket.socket, sink: socket.socket, held: bool) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(CHUNK):
                if held:
                    self._flows.wait()
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)
