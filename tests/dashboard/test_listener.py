"""The listening socket: the oldest request makes room; the bytes of a connection are limited."""

import contextlib
import socket
from collections import Counter
from collections.abc import Callable, Iterator

import pytest

from common.freshness import NS_PER_S
from services.dashboard import listener as module
from services.dashboard.listener import BYTES_BURST, BYTES_RATE, CHUNK, Listener

REQUESTS = 3


@pytest.fixture
def listener(monkeypatch: pytest.MonkeyPatch) -> Iterator[Listener]:
    monkeypatch.setattr(module, "REQUESTS", REQUESTS)
    with contextlib.closing(Listener(socket.AF_INET, Counter())) as it:
        it.bind(("127.0.0.1", 0))
        it.listen()
        yield it


def connected(listener: Listener) -> tuple[socket.socket, socket.socket]:
    """Return the client's end of a new connection, and the server's."""
    client = socket.create_connection(listener.getsockname())
    return client, listener.accept()[0]


def is_closed(client: socket.socket) -> bool:
    client.setblocking(False)
    try:
        return client.recv(1) == b""
    except BlockingIOError:
        return False


def test_the_oldest_requests_make_room(listener: Listener) -> None:
    with contextlib.ExitStack() as stack:
        pairs = [connected(listener) for _ in range(REQUESTS)]
        for end in (end for pair in pairs for end in pair):
            stack.enter_context(contextlib.closing(end))
        listener.upgraded(pairs[0][0].getsockname())
        pairs[1][1].close()  # both free a place
        for _ in range(3):
            pairs.append(connected(listener))
            for end in pairs[-1]:
                stack.enter_context(contextlib.closing(end))
        assert [is_closed(client) for client, _ in pairs] == [False, True, True, *[False] * 3]
        assert listener._counters["requests_displaced"] == 1


def test_a_port_that_a_client_uses_again_keeps_its_place(listener: Listener) -> None:
    client, server = connected(listener)
    peer = client.getsockname()
    other = listener._requests[peer]
    newer = module.Connection(socket.socket(), Counter(), lambda _: None)
    listener._requests[peer] = newer  # the same port, before the old connection is closed here
    other.close()
    assert listener._requests[peer] is newer
    for end in (client, server, newer):
        end.close()


@pytest.mark.parametrize(
    ("steps", "is_closed"),
    [
        ([(0, BYTES_BURST)], False),
        ([(0, BYTES_BURST), (0, 1)], True),
        ([(0, BYTES_BURST), (1.0, BYTES_RATE)], False),
        ([(0, BYTES_BURST), (1.0, BYTES_RATE + 1)], True),
        ([(3600.0, BYTES_BURST + 1)], True),  # a pause refills one burst at most
        ([(0.1, BYTES_RATE // 10)] * 100, False),
    ],
)
@pytest.mark.parametrize(
    "receive",
    [
        lambda end: len(end.recv(9999)),
        lambda end: end.recv_into(bytearray(9999), 9999),
    ],
    ids=["recv", "recv_into"],
)
def test_the_bytes_of_a_connection(
    listener: Listener,
    monkeypatch: pytest.MonkeyPatch,
    receive: Callable[[socket.socket], int],
    steps: list[tuple[float, int]],
    is_closed: bool,
) -> None:
    now_ns = 0
    monkeypatch.setattr("common.clock.now_ns", lambda: now_ns)
    client, server = connected(listener)
    with client, server:
        for pause_s, count in steps:
            now_ns += round(pause_s * NS_PER_S)
            client.sendall(bytes(count))
            left = count
            with contextlib.suppress(ConnectionAbortedError):
                while left:
                    received = receive(server)
                    assert 0 < received <= CHUNK
                    left -= received
    assert bool(left) == is_closed
    assert listener._counters["connections_aborted"] == is_closed
