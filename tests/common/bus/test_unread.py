"""Messages without a subscriber: none of them leaves the process."""

import contextlib
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

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
        self.sent = 0
        self._router = router.removeprefix("tcp/").split(":")
        self._server = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._server.getsockname()[1]}"

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        with self._server, ThreadPoolExecutor(2) as pool:
            pool.submit(self._run, pool)
            yield

    def _run(self, pool: ThreadPoolExecutor) -> None:
        host, port = self._router
        near, far = self._server.accept()[0], socket.create_connection((host, int(port)))
        back = pool.submit(self._copy, far, near, 0)
        self._copy(near, far, 1)
        back.result()
        near.close()
        far.close()

    def _copy(self, source: socket.socket, sink: socket.socket, counted: int) -> None:
        with contextlib.suppress(OSError):
            while part := source.recv(65_536):
                self.sent += counted * len(part)
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
