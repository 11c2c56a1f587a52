"""WebSocket hub: one WebSocket per browser, with bounded queues in both directions.

A slow browser gets fewer snapshots, never older ones: a new snapshot replaces the one that still
waits. A browser that does not read at all is disconnected. One that sends faster than its limit
loses messages and is disconnected if it continues. An emergency stop is never dropped, and is
handled before all calls that wait.
"""

import asyncio
import contextlib
import itertools
from collections import Counter, deque
from collections.abc import Callable, Collection
from functools import partial

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from common import clock
from services.dashboard.admission import RateLimit, Verdict
from services.dashboard.client_messages import AnyMessage, Estop
from services.dashboard.fleet import Fleet

OUTBOX_MAX = 64  # messages to one viewer
CALLS_MAX = 32  # messages of one viewer that the fleet has not handled
MESSAGE_MAX = 4096  # bytes
BURST_S = 4.0  # of messages at the full rate, after a network delay
ESTOP = '"estop"'  # in the text of every such message

Call = Callable[[], None]
Post = Callable[[Call], None]


class CallQueue:
    """The calls of one viewer that wait for the fleet's thread."""

    def __init__(self) -> None:
        self.calls: deque[Call] = deque()

    @property
    def is_full(self) -> bool:
        """Whether the next message must be dropped."""
        return len(self.calls) >= CALLS_MAX


class Inbox:
    """Posts calls to the fleet's thread, emergency stops first."""

    def __init__(self, post: Post) -> None:
        self._post = post
        self._stops: dict[str, Call] = {}

    def stop(self, robot: str, call: Call) -> None:
        """Make this call before others; it replaces a waiting one for the same robot."""
        self._stops[robot] = call
        self._post(self._make_stops)

    def put(self, queue: CallQueue, call: Call) -> None:
        """Make this call after those in the same queue."""
        queue.calls.append(call)
        self._post(lambda: self._make(queue))

    def _make(self, queue: CallQueue) -> None:
        self._make_stops()
        queue.calls.popleft()()

    def _make_stops(self) -> None:
        while self._stops:
            _, call = self._stops.popitem()
            call()


class Outbox:
    """The messages to one browser, in order."""

    def __init__(self) -> None:
        self._texts: deque[tuple[bytes, str]] = deque()
        self._has_text = asyncio.Event()
        self.full = False

    def put(self, text: bytes, replaces: bool) -> None:
        """Add a message; with ``replaces`` instead of a waiting one with the same first bytes."""
        kind = text[:12].decode(errors="replace") if replaces else ""
        if kind:
            self._texts = deque(waiting for waiting in self._texts if waiting[1] != kind)
        self._texts.append((text, kind))
        self.full = len(self._texts) > OUTBOX_MAX
        self._has_text.set()

    async def take(self) -> bytes:
        """Wait for the next message."""
        while not self._texts:
            self._has_text.clear()
            await self._has_text.wait()
        return self._texts.popleft()[0]


class WebSocketHub:
    """All WebSockets; runs in the server's thread and posts to the fleet's."""

    def __init__(self, post: Post, rate: float, counters: Counter[str]) -> None:
        self.fleet: Fleet | None = None
        self._post = post
        self._inbox = Inbox(post)
        self._rate = rate
        self._counters = counters
        self._outboxes: dict[str, Outbox] = {}
        self._ids = itertools.count(1)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._decoder: msgspec.json.Decoder[AnyMessage] = msgspec.json.Decoder(AnyMessage)

    def send(self, viewers: Collection[str], text: bytes, replaces: bool) -> None:
        """Send a message to these viewers; from any thread."""
        loop = self._loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # the server has just ended
                loop.call_soon_threadsafe(self._put, viewers, text, replaces)

    def estop(self, robot: str, requested_by: str) -> bool:
        """Stop a robot before all waiting calls; return whether the robot is known."""
        fleet = self.fleet
        if fleet is None or not fleet.knows(robot):
            return False
        self._inbox.stop(robot, lambda: fleet.estop(robot, requested_by))
        return True

    async def serve(self, socket: WebSocket) -> None:
        """Serve one browser until it disconnects."""
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
        limit, queue = RateLimit(self._rate, self._rate * BURST_S), CallQueue()
        with contextlib.suppress(WebSocketDisconnect, KeyError):  # a binary message has no text
            while True:
                text = await socket.receive_text()
                verdict = limit.take(clock.now_ns())
                if verdict is Verdict.ACCEPTED or ESTOP in text:
                    message = self._decode(text)
                    if message is None:
                        await socket.close(code=1003, reason="invalid message")
                        return
                    self._handle(viewer, message, queue, fleet)
                else:
                    self._counters["messages_dropped"] += 1
                if verdict is Verdict.ABUSIVE:
                    self._counters["viewers_closed"] += 1
                    await socket.close(code=1008, reason="too many messages")
                    return

    def _handle(self, viewer: str, message: AnyMessage, queue: CallQueue, fleet: Fleet) -> None:
        if isinstance(message, Estop):
            if message.robot and self.estop(message.robot, f"viewer {viewer}"):
                return
        elif queue.is_full:
            self._counters["messages_dropped"] += 1
            return
        self._inbox.put(queue, partial(fleet.handle, viewer, message))

    def _decode(self, text: str) -> AnyMessage | None:
        if len(text) > MESSAGE_MAX:
            return None
        try:
            return self._decoder.decode(text)
        except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
            return None

    async def _send(self, socket: WebSocket, outbox: Outbox) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while not outbox.full:
                text = (await outbox.take()).decode()
                await socket.send({"type": "websocket.send", "text": text})
            await socket.close(code=1013, reason="too slow")

    def _put(self, viewers: Collection[str], text: bytes, replaces: bool) -> None:
        for viewer in viewers:
            if outbox := self._outboxes.get(viewer):
                outbox.put(text, replaces)
