"""A network camera: a server of YUV4MPEG2 pictures at 20 Hz, which a test stalls and closes."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

WIDTH, HEIGHT, RATE = 64, 36, 20


class StreamServer:
    """Serves one reader; picture ``n`` has the luma ``n % 200 + 16``."""

    def __init__(self) -> None:
        self.sock = socket.create_server(("127.0.0.1", 0))
        self.source = f"tcp://127.0.0.1:{self.sock.getsockname()[1]}"
        self.stall_s = 0.0  # before the next picture; the ones after it come in a burst
        self.is_still = False  # the same picture again and again
        self.number = 0
        self._ended = threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    def close(self) -> None:
        """End the stream, and the server."""
        self._ended.set()
        self.sock.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            with suppress(OSError):
                client, _ = self.sock.accept()
                with client:
                    self._serve(client)

    def _serve(self, client: socket.socket) -> None:
        client.sendall(f"YUV4MPEG2 W{WIDTH} H{HEIGHT} F{RATE}:1 Ip A1:1 C420jpeg\n".encode())
        due = time.monotonic()
        while not self._ended.is_set():
            stall_s, self.stall_s = self.stall_s, 0.0
            time.sleep(max(0.0, due - time.monotonic()) + stall_s)
            due += 1 / RATE
            luma = 100 if self.is_still else self.number % 200 + 16
            size = WIDTH * HEIGHT
            client.sendall(b"FRAME\n" + bytes((luma,)) * size + bytes((128,)) * (size // 2))
            self.number += 1


@contextmanager
def stream_server() -> Iterator[StreamServer]:
    """Serve while the context lasts."""
    server = StreamServer()
    try:
        yield server
    finally:
        server.close()
