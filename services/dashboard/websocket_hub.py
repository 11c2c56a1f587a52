"""WebSocket hub: one WebSocket per browser.

A slow browser gets fewer snapshots, never older ones: a new snapshot replaces the one that still
waits. A browser that does not read at all is disconnected. An emergency stop is handled before all
calls that wait.
"""

import asyncio
import contextlib
import itertools
import re
from collections import deque
from collections.abc import Callable, Collection
from functools import partial

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from common.loop import Post
from services.dashboard import shift_log
from services.dashboard.client_messages import ROBOT, AnyMessage, Estop
from services.dashboard.fleet import Fleet
from t2.messages import Phrase
from t2.words import refusal

VIEWERS_MAX = 64
OUTBOX_MAX = 64  # messages to one viewer
MESSAGE_MAX = 4096  # bytes
LOG_S = 8.0  # wait for rows of the shift log: longer than the call for them

Call = Callable[[], None]


class Inbox:
    """Posts calls to the fleet's thread, emergency stops first."""

    def __init__(self, post: Post) -> None:
        self._post = post
        self._stops: dict[str, Call] = {}

    def stop(self, robot: str, call: Call) -> None:
        """Make this call before others; it replaces a waiting one for the same robot."""
        self._stops[robot] = call
        self._post(self._make_stops)

    def put(self, call: Call) -> None:
        """Make this call after earlier ones."""
        self._post(lambda: self._make(call))

    def _make(self, call: Call) -> None:
        self._make_stops()
        call()

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

    def __init__(self, post: Post, fleet: Fleet) -> None:
        self._fleet = fleet
        self._inbox = Inbox(post)
        self._outboxes: dict[str, Outbox] = {}
        self._ids = itertools.count(1)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._decoder: msgspec.json.Decoder[AnyMessage] = msgspec.json.Decoder(AnyMessage)
        fleet.send = self.send

    def send(self, viewers: Collection[str], text: bytes, replaces: bool) -> None:
        """Send a message to these viewers; from any thread."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the server has just ended
                self._loop.call_soon_threadsafe(self._put, viewers, text, replaces)

    def estop(self, robot: str, requested_by: str, age_s: float = 0.0) -> bool:
        """Stop a robot before all waiting calls; return whether the robot is known."""
        if not self._fleet.knows(robot):
            return False
        self._inbox.stop(robot, partial(self._fleet.estop, robot, requested_by, age_s))
        return True

    async def log(self, robot: str, before_ns: int | None) -> bytes | None:
        """Return rows of the shift log as JSON, or why there are none; None without an answer."""
        if not self._fleet.knows(robot):
            return shift_log.problem(refusal(Phrase("log.unknown_robot")))
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[bytes] = loop.create_future()

        def take(text: bytes) -> None:
            if not answer.done():
                answer.set_result(text)

        def send(text: bytes) -> None:
            with contextlib.suppress(RuntimeError):  # the server has just ended
                loop.call_soon_threadsafe(take, text)

        self._inbox.put(partial(self._fleet.log, robot, before_ns, send))
        try:
            return await asyncio.wait_for(answer, LOG_S)
        except TimeoutError:
            return None

    async def serve(self, socket: WebSocket) -> None:
        """Serve one browser, on the page of the robot in its query, until it disconnects."""
        robot = socket.query_params.get("robot", "")
        if not re.match(ROBOT, robot) or len(self._outboxes) >= VIEWERS_MAX:
            await socket.close()
            return
        self._loop = asyncio.get_running_loop()
        viewer, outbox = str(next(self._ids)), Outbox()
        await socket.accept()
        self._outboxes[viewer] = outbox
        self._inbox.put(partial(self._fleet.join, robot, viewer))
        sender = asyncio.create_task(self._send(socket, outbox))
        try:
            await self._receive(socket, robot, viewer)
        finally:
            del self._outboxes[viewer]
            self._inbox.put(partial(self._fleet.leave, robot, viewer))
            sender.cancel()

    async def _receive(self, socket: WebSocket, robot: str, viewer: str) -> None:
        with contextlib.suppress(WebSocketDisconnect, KeyError):  # a binary message has no text
            while True:
                message = self._decode(await socket.receive_text())
                if message is None:
                    await socket.close(code=1003, reason="invalid message")
                    return
                if isinstance(message, Estop):
                    self.estop(robot, message.name or f"viewer {viewer}", message.age)
                else:
                    self._inbox.put(partial(self._fleet.handle, robot, viewer, message))

    def _decode(self, text: str) -> AnyMessage | None:
        try:
            return self._decoder.decode(text)
        except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
            return None

    async def _send(self, socket: WebSocket, outbox: Outbox) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while not outbox.full:
                message = await outbox.take()
                is_text = message[:1] == b"{"
                part = {"text": message.decode()} if is_text else {"bytes": message}
                await socket.send({"type": "websocket.send", **part})
            await socket.close(code=1013, reason="too slow")

    def _put(self, viewers: Collection[str], text: bytes, replaces: bool) -> None:
        for viewer in viewers:
            if outbox := self._outboxes.get(viewer):
                outbox.put(text, replaces)
