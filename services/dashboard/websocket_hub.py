"""The browsers' end: a web socket for each, and what waits to be sent to it.

A browser that reads slowly gets fewer pictures, never older ones: a newer picture takes the place
of the one that still waits. One that does not read at all is closed. One that sends faster than
its limit has messages dropped, and is closed when it goes on; an emergency stop is never dropped.
"""

import asyncio
import contextlib
import itertools
import time
from collections import Counter, deque
from collections.abc import Collection
from functools import partial

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from services.dashboard.client_messages import AnyWord, Estop
from services.dashboard.fleet import Fleet
from services.dashboard.inbox import Inbox, Post, Queue
from services.dashboard.rate_limit import RateLimit, Verdict

WAITING_MAX = 64
WORD_MAX = 4096  # bytes
BURST_S = 4.0  # of messages at the full rate, after a network delay
ESTOP = '"estop"'  # in the text of every such message


class Outbox:
    """What waits to be sent to one browser, in order."""

    def __init__(self) -> None:
        self._texts: deque[tuple[bytes, str]] = deque()
        self._some = asyncio.Event()
        self.full = False

    def put(self, text: bytes, newer_wins: bool) -> None:
        """Add a text; one that is replaced by newer ones of its kind is told by its beginning."""
        kind = text[:12].decode(errors="replace") if newer_wins else ""
        if kind:
            self._texts = deque(waiting for waiting in self._texts if waiting[1] != kind)
        self._texts.append((text, kind))
        self.full = len(self._texts) > WAITING_MAX
        self._some.set()

    async def take(self) -> bytes:
        """Wait for the next text."""
        while not self._texts:
            self._some.clear()
            await self._some.wait()
        return self._texts.popleft()[0]


class Viewers:
    """All browsers; lives in the server's thread and posts to the fleet's."""

    def __init__(self, post: Post, rate: float, counters: Counter[str]) -> None:
        self.fleet: Fleet | None = None
        self._post = post
        self._inbox = Inbox(post)
        self._rate = rate
        self._counters = counters
        self._outboxes: dict[str, Outbox] = {}
        self._ids = itertools.count(1)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._words: msgspec.json.Decoder[AnyWord] = msgspec.json.Decoder(AnyWord)

    def show(self, viewers: Collection[str], text: bytes, newer_wins: bool) -> None:
        """Send a text to some of them; from any thread."""
        loop = self._loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # the server has just ended
                loop.call_soon_threadsafe(self._put, viewers, text, newer_wins)

    def estop(self, robot: str, who: str) -> bool:
        """Stop a robot ahead of everything that waits; return whether it is known."""
        fleet = self.fleet
        if fleet is None or not fleet.knows(robot):
            return False
        self._inbox.stop(robot, lambda: fleet.estop(robot, who))
        return True

    async def serve(self, socket: WebSocket) -> None:
        """Serve one browser until it is gone."""
        assert self.fleet is not None
        self._loop = asyncio.get_running_loop()
        fleet, viewer, outbox = self.fleet, str(next(self._ids)), Outbox()
        await socket.accept()
        self._outboxes[viewer] = outbox
        self._post(lambda: fleet.join(viewer))
        sender = asyncio.create_task(self._send(socket, outbox))
        try:
            await self._receive(socket, viewer, fleet)
        finally:
            del self._outboxes[viewer]
            self._post(lambda: fleet.leave(viewer))
            sender.cancel()

    async def _receive(self, socket: WebSocket, viewer: str, fleet: Fleet) -> None:
        limit, queue = RateLimit(self._rate, self._rate * BURST_S), Queue()
        with contextlib.suppress(WebSocketDisconnect, KeyError):  # a binary one has no text
            while True:
                text = await socket.receive_text()
                verdict = limit.take(time.monotonic_ns())
                if verdict is Verdict.ACCEPTED or ESTOP in text:
                    word = self._read(text)
                    if word is None:
                        await socket.close(code=1003, reason="not one of the words")
                        return
                    self._take_in(viewer, word, queue, fleet)
                else:
                    self._counters["messages_dropped"] += 1
                if verdict is Verdict.ABUSIVE:
                    self._counters["viewers_closed"] += 1
                    await socket.close(code=1008, reason="too many messages")
                    return

    def _take_in(self, viewer: str, word: AnyWord, queue: Queue, fleet: Fleet) -> None:
        if isinstance(word, Estop) and word.robot and self.estop(word.robot, f"viewer {viewer}"):
            return
        if queue.is_full and not isinstance(word, Estop):
            self._counters["messages_dropped"] += 1
            return
        self._inbox.put(queue, partial(fleet.take_in, viewer, word))

    def _read(self, text: str) -> AnyWord | None:
        if len(text) > WORD_MAX:
            return None
        try:
            return self._words.decode(text)
        except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
            return None

    async def _send(self, socket: WebSocket, outbox: Outbox) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while not outbox.full:
                text = (await outbox.take()).decode()
                await socket.send({"type": "websocket.send", "text": text})
            await socket.close(code=1013, reason="too slow")

    def _put(self, viewers: Collection[str], text: bytes, newer_wins: bool) -> None:
        for viewer in viewers:
            if outbox := self._outboxes.get(viewer):
                outbox.put(text, newer_wins)
