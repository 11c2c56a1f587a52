"""The compression of texts and not of pictures, on a real connection."""

import contextlib
import socket
import threading
from collections.abc import Iterator

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.sync.client import connect

from services.dashboard.websocket_protocol import WebSocketProtocol
from verification.harness.waiting import wait_until

TEXT = '{"k":"fast","pose":[1.0,2.0,0.5]}' * 3
HANDSHAKE = (
    "GET / HTTP/1.1\r\nHost: robot\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Extensions: permessage-deflate\r\n\r\n"
)
FREE = bytes([0x81, 0x84, 0, 0, 0, 0]) + b"free"  # a frame, masked with zeros
COMPRESSED_TEXT, PLAIN_BINARY = 0xC1, 0x82  # the first byte of a frame


async def echo(browser: WebSocket) -> None:
    """Answer each text with the same text and the same bytes."""
    await browser.accept()
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            text = await browser.receive_text()
            await browser.send_text(text)
            await browser.send_bytes(text.encode())


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    app = Starlette(routes=[WebSocketRoute("/", echo)])
    config = uvicorn.Config(
        app, port=0, ws=WebSocketProtocol, ws_per_message_deflate=True, lifespan="off",
        log_level="error",
    )  # fmt: skip
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    wait_until(lambda: server.started, "the server")
    yield server.servers[0].sockets[0].getsockname()[1]
    server.should_exit = True
    thread.join()


def test_both_kinds_arrive_in_both_directions(port: int) -> None:
    with connect(f"ws://127.0.0.1:{port}/") as browser:
        for number in range(50):
            browser.send(f"{TEXT}{number}")
        for number in range(50):
            assert browser.recv(timeout=10) == f"{TEXT}{number}"
            assert browser.recv(timeout=10) == f"{TEXT}{number}".encode()


def test_texts_are_compressed_and_pictures_are_not(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as browser:
        browser.sendall(HANDSHAKE.encode())
        stream = browser.makefile("rb")
        while stream.readline() != b"\r\n":
            pass
        browser.sendall(FREE)
        kind, length = stream.read(2)
        assert kind == COMPRESSED_TEXT
        stream.read(length)
        kind, length = stream.read(2)
        assert (kind, stream.read(length)) == (PLAIN_BINARY, b"free")
