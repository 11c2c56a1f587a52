"""Order of the calls that wait for the fleet's thread, and the messages to a slow browser."""

import asyncio
from types import SimpleNamespace
from typing import Any

from services.dashboard.websocket_hub import (
    OUTBOX_MAX,
    VIEWERS_MAX,
    Call,
    Inbox,
    Outbox,
    WebSocketHub,
)


def test_an_emergency_stop_is_made_before_waiting_calls() -> None:
    posted: list[Call] = []
    made: list[str] = []
    inbox = Inbox(posted.append)
    for name in ("first", "second"):
        inbox.put(lambda name=name: made.append(name))  # type: ignore[misc]
    inbox.stop("001", lambda: made.append("stop"))
    for call in posted:
        call()
    assert made == ["stop", "first", "second"]


def test_a_newer_snapshot_replaces_the_one_that_waits_and_no_other_message() -> None:
    async def taken() -> list[bytes]:
        outbox = Outbox()
        for number in range(3):
            outbox.put(b'{"k":"fast","n":%d}' % number, True)
            outbox.put(b'{"k":"slow","n":%d}' % number, True)
            outbox.put(b'{"k":"notice","n":%d}' % number, False)
        return [await outbox.take() for _ in range(5)]

    assert asyncio.run(taken()) == [
        b'{"k":"notice","n":0}',
        b'{"k":"notice","n":1}',
        b'{"k":"fast","n":2}',
        b'{"k":"slow","n":2}',
        b'{"k":"notice","n":2}',
    ]


def test_a_browser_that_takes_nothing_is_noticed() -> None:
    outbox = Outbox()
    for _ in range(OUTBOX_MAX):
        outbox.put(b"a notice", False)
        outbox.put(b"a snapshot", True)
        assert not outbox.full or len(outbox._texts) > OUTBOX_MAX
    assert outbox.full


def test_the_number_of_viewers_is_limited() -> None:
    done: list[str] = []

    class Socket:
        query_params = {"robot": "001"}  # noqa: RUF012 - read only

        async def accept(self) -> None:
            done.append("accepted")

        async def close(self) -> None:
            done.append("closed")

        async def receive_text(self) -> str:
            raise KeyError

    fleet: Any = SimpleNamespace(join=print, leave=print)
    socket: Any = Socket()
    hub = WebSocketHub(lambda _: None, fleet)
    for count in (VIEWERS_MAX - 1, VIEWERS_MAX):
        hub._outboxes = {str(-number): Outbox() for number in range(count)}
        asyncio.run(hub.serve(socket))
    assert done == ["accepted", "closed"]
