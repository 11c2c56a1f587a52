"""The gateway's node on the wire of ROS 2: publishers, subscriptions, services and their tokens.

A Zenoh session of its own, so that a gateway that is stopped takes all its tokens with it. Zenoh's
threads only stamp and queue what arrives; the service's loop handles it.
"""

import contextlib
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import xxhash
import zenoh
import zenoh.ext

from common import clock
from common.bus.bus import OverwritingQueue
from common.bus.session import client
from common.loop import Post
from common.settings import BusSettings
from services.ros2 import cdr, names
from services.ros2.cdr import Attachment, CdrError, Value

Take = Callable[[Attachment, Value, int], None]  # sender, message, receive time (monotonic, ns)
Answer = Callable[[Value], None]
Serve = Callable[[Attachment, Value, Answer], None]  # the client, its request; None: unreadable
Seen = Callable[[str, bool], None]  # a token, and whether it appeared
Declare = Callable[[zenoh.Session, str, str], Any]  # with the key and the token of an endpoint

DEPTH = 32  # commands that wait for the loop
MAX_BYTES = 4096  # of a command or request; a TwistStamped has some 80
LATCHED: dict[str, Any] = {
    "publisher_detection": True,
    "sample_miss_detection": zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
}
# A slow ROS node must not block the gateway.
QOS: dict[str, Any] = {"congestion_control": zenoh.CongestionControl.DROP}


def gid(token: str) -> bytes:
    """Return the GID of an endpoint."""
    return xxhash.xxh3_128_digest(token.encode())[::-1]


class Publisher:
    """A publisher of one topic; drops messages until there is a session."""

    def __init__(self, interface: str) -> None:
        self._interface = interface
        self._declared: Any = None
        self._gid = b""
        self._sequence = 0
        self._waiting: Value = None

    def put(self, message: Value) -> None:
        """Send a message; the last one before the session is sent when there is one."""
        if self._declared is None:
            self._waiting = message
            return
        self._sequence += 1
        about = Attachment(self._sequence, time.time_ns(), self._gid)
        self._declared.put(cdr.encode(self._interface, message), attachment=about.encode())

    def declared(self, publisher: Any, gid: bytes) -> None:
        """Take the session's publisher."""
        self._declared, self._gid = publisher, gid
        if self._waiting is not None:
            self.put(self._waiting)


class Endpoints:
    """The node with all its endpoints; declare first, then ``open``."""

    def __init__(
        self, where: BusSettings, node: names.Node, post: Post, counters: Counter[str]
    ) -> None:
        self.counters = counters
        counters.update(undecodable=0, overrun=0)  # Zenoh's threads must not add names
        self._node = node
        self._post = post
        self._number = 0
        self._session = client(where, post)
        self._session.declare(self._join)

    def open(self, opened: Callable[[], None]) -> None:
        """Start connecting; returns at once. ``opened`` is called when the session opens."""
        self._session.declare(lambda _: opened())
        self._session.open()

    def close(self) -> None:
        """Close the session: all tokens disappear."""
        self._session.close()

    def publisher(self, topic: str, interface: str, *, kept: int = 0) -> Publisher:
        """Return a publisher of an absolute topic; late subscribers get the last ``kept`` samples.

        With any it is transient local in the words of ROS.
        """
        made = Publisher(interface)

        def declare(session: zenoh.Session, key: str, token: str) -> Any:
            if kept:
                cache = zenoh.ext.CacheConfig(max_samples=kept)
                sent: Any = zenoh.ext.declare_advanced_publisher(
                    session, key, cache=cache, **LATCHED
                )
            else:
                sent = session.declare_publisher(key, **QOS)
            made.declared(sent, gid(token))
            return sent

        self._declare("MP", topic, interface, declare, names.qos(kept))
        return made

    def subscribe(
        self, topic: str, interface: str, take: Take, refused: Callable[[str], None]
    ) -> None:
        """Call ``take`` for each message; ``refused`` gets the error of unreadable ones."""

        def read(stamped: tuple[zenoh.Sample, int]) -> None:
            sample, received_ns = stamped
            try:
                about = _attachment(sample)
                message = cdr.decode(interface, sample.payload.to_bytes())
            except CdrError as error:
                self.counters["undecodable"] += 1
                refused(str(error))
            else:
                take(about, message, received_ns)

        waiting = OverwritingQueue(DEPTH, read, self._post, self.counters)

        def queue(sample: zenoh.Sample) -> None:
            if not self._is_too_long(sample):
                waiting.put((sample, clock.now_ns()))

        self._declare(
            "MS", topic, interface, lambda session, key, _: session.declare_subscriber(key, queue)
        )

    def serve(self, service: str, interface: str, handle: Serve) -> None:
        """Answer the requests of a service; ``handle`` calls the answer once, now or later."""
        key = names.data_key(self._node.domain, service, interface)

        def answer(query: zenoh.Query) -> None:
            self._answer(query, key, interface, handle)

        waiting = OverwritingQueue(DEPTH, answer, self._post, self.counters)

        def queue(query: zenoh.Query) -> None:
            if self._is_too_long(query):
                query.drop()
            else:
                waiting.put(query)

        def declare(session: zenoh.Session, key: str, _: str) -> Any:
            return session.declare_queryable(key, queue, complete=True)

        self._declare("SS", service, interface, declare)

    def _is_too_long(self, sent: zenoh.Sample | zenoh.Query) -> bool:
        is_long = sent.payload is not None and len(sent.payload) > MAX_BYTES
        self.counters["undecodable"] += is_long
        return is_long

    def _answer(self, query: zenoh.Query, key: str, interface: str, handle: Serve) -> None:
        try:
            about = _attachment(query)
        except CdrError:  # no answer would reach the client
            self.counters["undecodable"] += 1
            query.drop()
            return

        def answer(message: Value) -> None:
            reply = Attachment(about.sequence, time.time_ns(), about.gid)
            encoded = cdr.encode(f"{interface}_Response", message)
            with contextlib.suppress(zenoh.ZError):  # the client may have gone
                query.reply(key, encoded, attachment=reply.encode())
            query.drop()

        request = None
        try:
            payload = query.payload.to_bytes() if query.payload else cdr.HEADER
            request = cdr.decode(f"{interface}_Request", payload)
        except CdrError:
            self.counters["undecodable"] += 1
        handle(about, request, answer)

    def watch(self, seen: Seen) -> None:
        """Call ``seen`` for each token of the domain that appears or disappears."""

        def queue(sample: zenoh.Sample) -> None:
            token, appeared = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            self._post(lambda: seen(token, appeared))

        key = f"{names.LIVELINESS}/{self._node.domain}/**"
        self._session.declare(
            lambda session: session.liveliness().declare_subscriber(key, queue, history=True)
        )

    def _join(self, session: zenoh.Session) -> Any:
        self._node = self._node._replace(zid=str(session.info.zid()))
        return session.liveliness().declare_token(self._node.token)

    def _declare(
        self, kind: str, topic: str, interface: str, declare: Declare, qos: str = names.QOS
    ) -> None:
        """Declare an endpoint with its token in each session."""
        self._number += 1
        number, key = self._number, names.data_key(self._node.domain, topic, interface)

        def both(session: zenoh.Session) -> Any:
            token = self._node.endpoint_token(number, kind, topic, interface, qos)
            return declare(session, key, token), session.liveliness().declare_token(token)

        self._session.declare(both)


def _attachment(sent: zenoh.Sample | zenoh.Query) -> Attachment:
    return cdr.attachment(sent.attachment.to_bytes() if sent.attachment else b"")
