"""One process on the bus: what it publishes, subscribes to, answers and calls."""

import contextlib
import os
import time
from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

import zenoh
import zenoh.ext
from msgspec import Struct

from common import clock, settings
from common.bus.publisher import QUERY_CONGESTION, Publisher, host_id, qos
from common.bus.session import Session, client
from common.loop import Post
from t2 import codec
from t2.codec import Sample
from t2.errors import MessageError
from t2.keys import ESTOP_CLASS, Call, Topic, estop_key
from t2.messages import Message, Phrase, Refusal
from t2.words import refusal

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Struct)
R = TypeVar("R", bound=Struct)
T = TypeVar("T")
Stamped = tuple[zenoh.Sample, int]  # with its receive time, in monotonic nanoseconds

QUERIES = 8  # of each key that wait for ``answer_queries``


class Arrival(Struct, Generic[M], frozen=True):
    """A received message with its local receive time, and the raw frame if attached."""

    message: M
    key: str
    received_ns: int
    raw: bytes | None


class Caller(Generic[R]):
    """The caller of a served call; answer it once, now or later."""

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self._query = query
        self._key = key

    def reply(self, message: R) -> None:
        """Answer with the reply."""
        encoding = codec.encoding(type(message))
        with contextlib.suppress(zenoh.ZError):  # the caller may have disconnected
            self._query.reply(self._key, codec.encode(message), encoding=encoding)
        self._query.drop()

    def refuse(self, *reasons: Phrase) -> None:
        """Answer with the reasons of the refusal."""
        with contextlib.suppress(zenoh.ZError):
            encoding = codec.encoding(Refusal)
            self._query.reply_err(codec.encode(refusal(*reasons)), encoding=encoding)
        self._query.drop()

    def ignore(self) -> None:
        """Leave the answer to another server of the same key."""
        self._query.drop()


class OverwritingQueue(Generic[T]):
    """Queue from Zenoh's threads to ``take`` in the owner's; overwritten items are ``overrun``."""

    def __init__(
        self, depth: int, take: Callable[[T], None], post: Post, counters: Counter[str]
    ) -> None:
        self._items: deque[T] = deque(maxlen=depth)
        self._take = take
        self._post = post
        self._counters = counters
        self._posted = False

    def put(self, item: T) -> None:
        """Append an item, on a thread of Zenoh; never waits."""
        if len(self._items) == self._items.maxlen:
            self._counters["overrun"] += 1
        self._items.append(item)
        if not self._posted:
            self._posted = True
            self._post(self._drain)

    def _drain(self) -> None:
        self._posted = False  # first: an item that comes now posts again
        for _ in range(len(self._items)):  # in a flood, timers and sockets have their turn, too
            self._take(self._items.popleft())


class Bus:
    """A client of a router: declare first, then ``open``.

    All handlers are called in the owner's thread: ``post`` passes a call to it. Zenoh's threads
    only stamp and queue what arrives.
    """

    def __init__(self, where: settings.BusSettings, robot: str, post: Post) -> None:
        self.where = where
        self.robot = robot
        # Not by `secrets`: it loads OpenSSL, 5 ms and 5 MB in each process.
        self.boot = int.from_bytes(os.urandom(8), "big") >> 1
        self.host = host_id()
        self.counts: Counter[str] = Counter()  # messages by key, sent and received
        # Errors by name. All names exist from the start: Zenoh's threads must not add one while the
        # loop reads them.
        self.counters: Counter[str] = Counter(overrun=0, undecodable=0)
        self.publishers: list[Publisher[Any]] = []
        self.post = post
        self._session = client(where, post)
        self.sessions = [self._session]  # with private ones, which open and close with it
        self._queries: list[tuple[zenoh.Queryable[Any], Callable[[zenoh.Query], None]]] = []
        self._closed = False

    def open(self) -> None:
        """Start connecting; returns at once."""
        for session in self.sessions:
            session.open()

    def close(self) -> None:
        """Close the session; no handler is called after that."""
        self._closed = True
        for publisher in self.publishers:
            publisher.withdraw()
        for session in self.sessions:
            session.close()

    @property
    def connection(self) -> int:
        """Number of the connection to a router, rising; 0: none."""
        return self._session.connection

    @property
    def connected(self) -> bool:
        """Whether there is a connection now."""
        return self.connection > 0

    # --- samples ----------------------------------------------------------------------------

    def publisher(self, topic: Topic[M], **names: str) -> Publisher[M]:
        """Return a publisher for a topic of this robot."""
        key = topic.on(self.robot, **names)
        publisher = Publisher(topic, key, self.boot, self.counts, self.host)
        self.publishers.append(publisher)
        self._session.declare(publisher.declare)
        return publisher

    def subscribe(
        self,
        topic: Topic[M],
        handler: Callable[[Arrival[M]], None],
        *,
        depth: int = 1,
        refused: Callable[[str, MessageError], None] | None = None,
        session: Session | None = None,
        post: Post | None = None,
        **names: str,
    ) -> None:
        """Call the handler for each message, with a queue of ``depth``.

        When the queue is full, the oldest message is dropped. ``post`` may be ``Loop.defer``, for
        messages that wait until the owner wakes up. ``refused`` gets key and error of an
        undecodable message; it is counted in any case. Where a name is ``*``, all keys are counted
        together, because any client can invent names.
        """
        expression = topic.on(self.robot, **names)
        only = "" if "*" in expression else expression  # reading the key of a sample takes time

        def take(stamped: Stamped) -> None:
            sample, received_ns = stamped
            key = only or str(sample.key_expr)
            self.counts[expression] += 1
            try:
                message = codec.decode(sample.payload.to_bytes(), topic.message)
            except MessageError as error:
                self.counters["undecodable"] += 1
                if refused:
                    refused(key, error)
                return
            raw = sample.attachment.to_bytes() if sample.attachment else None
            handler(Arrival(message, key, received_ns, raw))

        history = topic.service.history
        self._subscribe(expression, take, depth, history=history, session=session, post=post)

    def tap(self, expression: str, handler: Callable[[Sample], None], *, depth: int) -> None:
        """Call the handler with each raw sample on these keys; see ``subscribe``.

        ``**`` in an expression does not match chunks that begin with ``@``.
        """

        def take(stamped: Stamped) -> None:
            sample, received_ns = stamped
            late_ns = clock.now_ns() - received_ns
            handler(copied(sample, received_ns, time.time_ns() - late_ns))

        self._subscribe(expression, take, depth)

    def on_any(self, key: str, handler: Callable[[int], None]) -> None:
        """Call the handler with the receive time for any PUT or DELETE on a key."""
        self._subscribe(key, lambda stamped: handler(stamped[1]), depth=1)

    def announce(self, key: str) -> None:
        """Declare a subscriber of a key whose samples another subscription handles."""
        self._session.declare(lambda session: session.declare_subscriber(key, lambda _: None))

    def estop(self) -> None:
        """Stop this robot; latches in safety."""
        if self._session.zenoh is not None:
            self._session.zenoh.put(estop_key(self.robot), b"", **qos(ESTOP_CLASS))

    # --- liveliness ---------------------------------------------------------------------------

    def live(self, key: str) -> None:
        """Declare a liveliness token."""
        self._session.declare(lambda session: session.liveliness().declare_token(key))

    def watch_live(self, expression: str, handler: Callable[[str, bool], None]) -> None:
        """Call the handler with each liveliness key that appears or disappears."""

        def queue(sample: zenoh.Sample) -> None:
            key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            self._hand_over(lambda: handler(key, alive))

        self._session.declare(
            lambda session: session.liveliness().declare_subscriber(expression, queue, history=True)
        )

    # --- queries ------------------------------------------------------------------------------

    def serve(self, call: Call[Q, R], handler: Callable[[Q, Caller[R]], None]) -> None:
        """Answer a call: the handler replies or refuses, at once or later."""
        key = call.on(self.robot)

        def take(query: zenoh.Query) -> None:
            self.counts[key] += 1
            caller: Caller[R] = Caller(query, key)
            payload = query.payload.to_bytes() if query.payload else codec.EMPTY
            try:
                request = codec.decode(payload, call.request)
            except MessageError as error:
                self.counters["undecodable"] += 1
                caller.refuse(Phrase("call.invalid", {"reason": str(error)}))
                return
            handler(request, caller)

        self._queryable(key, take)

    def answer(self, key: str, make: Callable[[], bytes], encoding: str) -> None:
        """Answer any query on a key with the bytes that ``make`` returns."""

        def take(query: zenoh.Query) -> None:
            with contextlib.suppress(zenoh.ZError):
                query.reply(key, make(), encoding=encoding)
            query.drop()

        self._queryable(key, take)

    def answer_queries(self) -> None:
        """Answer one waiting query of each key; the owner's thread calls it periodically.

        Queries wait in Zenoh, and the oldest ones are dropped: a flood of them takes no time from
        this process.
        """
        if not self._closed:
            for queryable, take in self._queries:
                if query := queryable.try_recv():
                    take(query)

    def call(
        self,
        call: Call[Q, R],
        request: Q,
        on_reply: Callable[[R], None],
        on_refusal: Callable[[Refusal], None],
        timeout_s: float = 2.0,
    ) -> None:
        """Make a call; exactly one of both handlers is called."""
        if self._session.zenoh is None:
            self._hand_over(lambda: on_refusal(refusal(Phrase("call.not_connected"))))
            return
        ended = False

        def end(reply: zenoh.Reply | None) -> None:
            nonlocal ended
            if not ended:
                ended = True
                _deliver(call, reply, on_reply, on_refusal)

        def queue(reply: zenoh.Reply) -> None:
            if not is_timeout(reply):
                self._hand_over(lambda: end(reply))

        self._session.zenoh.get(
            call.on(self.robot),
            zenoh.handlers.Callback(queue, lambda: self._hand_over(lambda: end(None))),
            payload=codec.encode(request),
            timeout=timeout_s,
            congestion_control=QUERY_CONGESTION,
            priority=getattr(zenoh.Priority, call.priority),
        )

    # --- on Zenoh's threads -------------------------------------------------------------------

    def _hand_over(self, call: Callable[[], None]) -> None:
        """Pass a call to the owner's thread, which skips it once the bus is closed."""
        self.post(lambda: None if self._closed else call())

    def _subscribe(
        self,
        key: str,
        take: Callable[[Stamped], None],
        depth: int,
        *,
        history: int = 0,
        session: Session | None = None,
        post: Post | None = None,
    ) -> None:
        def take_if_open(stamped: Stamped) -> None:
            if not self._closed:
                take(stamped)

        items = OverwritingQueue(depth, take_if_open, post or self.post, self.counters)

        def queue(sample: zenoh.Sample) -> None:
            items.put((sample, clock.now_ns()))

        (session or self._session).declare(partial(_subscriber, key, queue, history))

    def _queryable(self, key: str, take: Callable[[zenoh.Query], None]) -> None:
        def declare(session: zenoh.Session) -> None:
            queryable = session.declare_queryable(key, zenoh.handlers.RingChannel(QUERIES))
            self._queries.append((queryable, take))

        self._session.declare(declare)


def _deliver(
    call: Call[Q, R],
    reply: zenoh.Reply | None,
    on_reply: Callable[[R], None],
    on_refusal: Callable[[Refusal], None],
) -> None:
    """Call the handler that fits the reply to a call; None: there was none."""
    if reply is None:
        on_refusal(no_answer(call.server))
    elif reply.ok is None:
        on_refusal(codec.refusal(reply.err.payload.to_bytes() if reply.err else b""))
    else:
        try:
            answer = codec.decode(reply.ok.payload.to_bytes(), call.reply)
        except MessageError as error:
            on_refusal(refusal(Phrase("call.invalid", {"reason": str(error)})))
        else:
            on_reply(answer)


def copied(sample: zenoh.Sample, received_ns: int, wall_ns: int) -> Sample:
    """Return a copy of a sample, without Zenoh's buffers."""
    return Sample(
        key=str(sample.key_expr),
        payload=sample.payload.to_bytes(),
        encoding=str(sample.encoding),
        deleted=sample.kind == zenoh.SampleKind.DELETE,
        raw=sample.attachment.to_bytes() if sample.attachment else None,
        received_ns=received_ns,
        wall_ns=wall_ns,
    )


def _subscriber(
    key: str, queue: Callable[[zenoh.Sample], None], history: int, session: zenoh.Session
) -> Any:
    """Declare a subscriber; with ``history`` it gets samples from before, and lost ones."""
    if not history:
        return session.declare_subscriber(key, queue)
    return zenoh.ext.declare_advanced_subscriber(
        session,
        key,
        queue,
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True),
        recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
    )


def is_timeout(reply: zenoh.Reply) -> bool:
    """Return whether a reply is Zenoh's own "Timeout", not a server's refusal."""
    return reply.err is not None and reply.err.payload.to_bytes() == b"Timeout"


def no_answer(server: str, doctor: str = "`t2 doctor`") -> Refusal:
    """Return the refusal of a call without any answer; ``doctor`` is the command to run."""
    return refusal(Phrase("call.no_answer", {"service": server, "doctor": doctor}))


def not_allowed(server: str) -> Refusal:
    """Return the refusal of a call without any answer from a service whose messages arrive.

    A router whose access rules forbid a call drops it without an error.
    """
    return refusal(Phrase("call.not_allowed", {"service": server}))
