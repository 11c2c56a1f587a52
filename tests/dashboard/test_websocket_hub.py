"""Order of the calls that wait for the fleet's thread, and the messages to a slow browser."""

import asyncio

from services.dashboard.websocket_hub import (
    OUTBOX_MAX,
    Call,
    Inbox,
    Outbox,
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
