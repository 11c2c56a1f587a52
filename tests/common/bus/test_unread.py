"""Messages without a subscriber: none of them leaves the process."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

from common import keys
from common import messages as m
from common.bus.bus import Bus
from common.bus.publisher import Publisher
from common.loop import Loop
from verification.harness.bus import bus_on, running
from verification.harness.waiting import wait_until

MESSAGES = 300
BYTES_MAX = 5_000  # Zenoh keeps the link alive; the messages have over 50,000


class Relay:
    """Passes one TCP connection on to a router and counts the bytes towards it."""

    def __init__(self, router: str) -> None:
        host, port = router.removeprefix("tcp/").split(":")
        self.sent = 0
        self._router = host, int(port)
        self._server = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._server.getsockname()[1]}"

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        with self._server:
            thread = threading.Thread(target=self._run)
            thread.start()
            yield
            thread.join()

    def _run(self) -> None:
        near, _ = self._server.accept()
        with near, socket.create_connection(self._router) as far:
            back = threading.Thread(target=self._copy, args=(far, near, False))
            back.start()
            self._copy(near, far, True)
            back.join()

    def _copy(self, source: socket.socket, sink: socket.socket, counted: bool) -> None:
        with contextlib.suppress(OSError):
            while part := source.recv(65_536):
                self.sent += len(part) if counted else 0
                sink.sendall(part)
            sink.shutdown(socket.SHUT_WR)


def bytes_of(relay: Relay, publisher: Publisher[m.Odometry]) -> int:
    """Publish the messages; return the bytes that reach the router meanwhile."""
    message = m.Odometry(
        x=1.0, y=2.0, heading=0.1, linear=0.3, angular=0.1, epoch=0, residual=None, slip=False,
        pose_covariance=(1.0,) * 9, twist_covariance=(1.0,) * 4,
    )  # fmt: skip
    time.sleep(0.3)  # until the declarations have passed
    before = relay.sent
    for _ in range(MESSAGES):
        publisher.put(message)
        time.sleep(0.001)
    time.sleep(0.3)
    return relay.sent - before


def test_odometry_without_a_subscriber_is_not_sent(endpoint: str) -> None:
    relay = Relay(endpoint)
    with relay.running(), running(Loop()) as loop:
        odometry: list[Publisher[m.Odometry]] = []

        def declare(bus: Bus) -> None:
            odometry.append(bus.publisher(keys.ODOMETRY))

        with bus_on(relay.endpoint, loop, declare):
            (publisher,) = odometry
            unread = bytes_of(relay, publisher)
            with bus_on(endpoint, loop, lambda bus: bus.subscribe(keys.ODOMETRY, lambda _: None)):
                wait_until(lambda: publisher.passed_on, "a subscriber")
                read = bytes_of(relay, publisher)
    assert unread < BYTES_MAX
    assert read > 10 * BYTES_MAX
