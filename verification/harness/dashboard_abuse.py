"""Abusive clients of the web server: message floods and endless requests."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
from websockets.typing import Origin

from verification.harness.dashboard import Server

TEXT, PING = 0x81, 0x89  # first bytes of WebSocket frames
BATCH = 500
PER_SECOND = 50_000


def frame(text: bytes, kind: int = TEXT) -> bytes:
    """Return a short WebSocket frame, masked with zeros."""
    return bytes([kind, 0x80 | len(text)]) + bytes(4) + text


FLOODS = {
    "hold": frame(b'{"k":"hold","n":1,"x":0.1,"y":0.2}'),
    "look": frame(b'{"k":"look","robot":"001"}'),
    "free": frame(b'{"k":"free"}'),
    "ping": frame(b"", PING),
}


def flood(server: Server, message: bytes, stop: threading.Event) -> None:
    """Send a frame at ``PER_SECOND``, reconnecting as needed, until stopped."""
    batch = message * BATCH
    origin = Origin(server.url.rstrip("/"))
    while not stop.is_set():
        with (
            contextlib.suppress(OSError, WebSocketException, TimeoutError),
            connect(f"ws://127.0.0.1:{server.port}/live", origin=origin, open_timeout=5) as viewer,
        ):
            began = time.monotonic()
            sent = 0
            while not stop.is_set():
                viewer.socket.sendall(batch)
                sent += BATCH
                time.sleep(max(0.0, began + sent / PER_SECOND - time.monotonic()))
        stop.wait(0.05)


@contextlib.contextmanager
def flooded(server: Server, message: bytes) -> Iterator[None]:
    """Flood the server while the context lasts."""
    stop = threading.Event()
    thread = threading.Thread(target=flood, args=(server, message, stop), daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(10)


@contextlib.contextmanager
def half_open(server: Server, count: int) -> Iterator[list[socket.socket]]:
    """Open this many connections, each with a request whose header never ends."""
    with contextlib.ExitStack() as stack:
        opened = []
        for _ in range(count):
            it = stack.enter_context(
                socket.create_connection(("127.0.0.1", server.port), timeout=5)
            )
            with contextlib.suppress(OSError):  # it may be closed at once
                it.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
            opened.append(it)
        yield opened


def is_closed(it: socket.socket) -> bool:
    """Return whether the server has ended a connection."""
    it.setblocking(False)
    try:
        return it.recv(4096) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True
