"""One Zenoh session of one process, with its declarations."""

import contextlib
import os
import time
from collections import Counter
from collections.abc import Callable, Collection
from typing import Any, Generic, TypeVar

import zenoh
import zenoh.ext
from msgspec import Struct

from common import clock, codec, settings
from common.bus.calls import Answers, Caller
from common.bus.publisher import QUERY_CONGESTION, Publisher, host_id, qos
from common.bus.session import Opener, copied
from common.bus.subscriber import Post, Subscriber, Take
from common.errors import MessageError
from common.keys import ESTOP_CLASS, Call, Topic, estop_key, info_key
from common.messages import Message
from common.sample import Sample

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Struct)
R = TypeVar("R", bound=Struct)

QUERIES = 8  # of each key that wait for ``answer_queries``


class Arrival(Struct, Generic[M], frozen=True):
    """A received message with its local receive time, and the raw frame if attached."""

    message: M
    key: str
    received_ns: int
    raw: bytes | None


class Bus:
    """One Zenoh session of one process.

    Declare first, then ``open``: a thread retries until a router answers, and the declarations are
    made as soon as the session is open. Zenoh renews them after a router's restart.

    ``post`` passes a call to the owner's thread. ``submit`` passes it the handling of a sample or
    an answer, which by default is the same.
    """

    def __init__(
        self, where: settings.BusSettings, robot: str, post: Post, submit: Post | None = None
    ) -> None:
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
        self.submit = submit or post
        self._declarations: list[Callable[[zenoh.Session], Any]] = []
        self._declared: list[Any] = []  # references keep them alive
        self._queries: list[tuple[zenoh.Queryable[Any], Callable[[zenoh.Query], None]]] = []
        self._session: zenoh.Session | None = None
        self._transports = self._opened = 0  # open now; opened since the start
        self._closed = False
        self.where = where
        self.links: list[Bus] = []  # private sessions that open and close with this one
        self._opener = self.opener(lambda session: post(lambda: self._adopt(session)))

    # --- declarations ---------------------------------------------------------------------

    def publisher(self, topic: Topic[M], **names: str) -> Publisher[M]:
        """Return a publisher for a topic of this robot."""
        key = topic.on(self.robot, **names)
        publisher = Publisher(topic, key, self.boot, self.counts, self.host)
        self.publishers.append(publisher)
        self._declare(publisher.declare)
        return publisher

    def subscribe(
        self,
        topic: Topic[M],
        handler: Callable[[Arrival[M]], None],
        *,
        depth: int = 1,
        refused: Callable[[str, MessageError], None] | None = None,
        known: Collection[str] = (),
        **names: str,
    ) -> None:
        """Call the handler for each message, with a queue of ``depth``.

        When the queue is full, the oldest message is dropped. ``refused`` gets key and error of an
        undecodable message; it is counted in any case. Where a name is ``*``, the ``known`` ones
        are counted one by one and all others together, because any client can invent names.
        """
        expression = topic.on(self.robot, **names)
        only = "" if "*" in expression else expression  # reading the key of a sample takes time
        single = topic.known(self.robot, names, known) | {expression}

        def take(sample: zenoh.Sample, received_ns: int) -> None:
            key = only or str(sample.key_expr)
            self.counts[key if key in single else expression] += 1
            try:
                message = codec.decode(sample.payload.to_bytes(), topic.message)
            except MessageError as error:
                self.counters["undecodable"] += 1
                if refused:
                    refused(key, error)
                return
            raw = sample.attachment.to_bytes() if sample.attachment else None
            handler(Arrival(message, key, received_ns, raw))

        self._subscribe(expression, take, depth, topic.service.history)

    def tap(self, expression: str, handler: Callable[[Sample], None], *, depth: int) -> None:
        """Call the handler with each raw sample on these keys; see ``subscribe``.

        ``**`` in an expression does not match chunks that begin with ``@``.
        """

        def take(sample: zenoh.Sample, received_ns: int) -> None:
            late_ns = clock.now_ns() - received_ns
            handler(copied(sample, received_ns, time.time_ns() - late_ns))

        self._subscribe(expression, take, depth, history=0)

    def on_any(self, key: str, handler: Callable[[int], None]) -> None:
        """Call the handler with the receive time for any PUT or DELETE on a key."""
        self._subscribe(key, lambda _, received_ns: handler(received_ns), depth=1, history=0)

    def announce(self, key: str) -> None:
        """Declare a subscriber of a key whose samples another subscription handles."""
        self._declare(lambda session: session.declare_subscriber(key, lambda _: None))

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
                caller.refuse(str(error))
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

    def live(self, key: str) -> None:
        """Declare a liveliness token."""
        self._declare(lambda session: session.liveliness().declare_token(key))

    def watch_live(self, expression: str, handler: Callable[[str, bool], None]) -> None:
        """Call the handler with each liveliness key that appears or disappears."""

        def queue(sample: zenoh.Sample) -> None:
            key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            self._hand_over(lambda: handler(key, alive))

        self._declare(
            lambda session: session.liveliness().declare_subscriber(expression, queue, history=True)
        )

    def call(
        self,
        call: Call[Q, R],
        request: Q,
        on_reply: Callable[[R], None],
        on_refusal: Callable[[str], None],
        timeout_s: float = 2.0,
    ) -> None:
        """Make a call; exactly one of both handlers is called."""

        def read(payload: bytes) -> R:
            return codec.decode(payload, call.reply)

        answers = Answers(call.server, read, on_reply, on_refusal, self._hand_over)
        self._query(call.on(self.robot), codec.encode(request), answers, timeout_s)

    def look_up(
        self,
        service: str,
        part: str,
        on_answer: Callable[[bytes], None],
        on_refusal: Callable[[str], None],
        timeout_s: float = 2.0,
    ) -> None:
        """Query a service's ``schema``, ``config`` or ``last`` as JSON; calls one handler."""
        answers = Answers(service, bytes, on_answer, on_refusal, self._hand_over)
        self._query(info_key(self.robot, service, part), None, answers, timeout_s)

    def estop(self) -> None:
        """Stop this robot; latches in safety."""
        if self._session is not None:
            self._session.put(estop_key(self.robot), b"", **qos(ESTOP_CLASS))

    # --- session -----------------------------------------------------------------------------

    def opener(self, adopt: Callable[[zenoh.Session], None]) -> Opener:
        """Return the opener of the session."""
        return Opener(self.where, adopt)

    def open(self) -> None:
        """Start connecting; returns at once."""
        for bus in (self, *self.links):
            bus._opener.start()

    @property
    def connection(self) -> int:
        """Number of the connection to a router or a drive link's other end, rising; 0: none."""
        return self._opened if self._session is not None and self._transports else 0

    @property
    def connected(self) -> bool:
        """Whether there is a connection now."""
        return self.connection > 0

    def close(self) -> None:
        """Close the session; no handler is called after that."""
        self._closed = True
        for publisher in self.publishers:
            publisher.withdraw()
        self._session = None
        self._opener.close()
        for link in self.links:
            link.close()

    def _adopt(self, session: zenoh.Session) -> None:
        if self._closed:
            return
        self._declared.append(
            session.info.declare_transport_events_listener(self._on_transport, history=True)
        )
        self._declared += [declare(session) for declare in self._declarations]
        self._session = session

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        """Count a transport that was opened or closed, on a thread of Zenoh."""
        opened = event.kind == zenoh.SampleKind.PUT
        self._transports += 1 if opened else -1
        self._opened += opened

    def _declare(self, declare: Callable[[zenoh.Session], Any]) -> None:
        self._declarations.append(declare)
        if self._session is not None:
            self._declared.append(declare(self._session))

    def _hand_over(self, call: Callable[[], None]) -> None:
        """Submit the call, unless the bus is closed by then."""
        self.submit(lambda: None if self._closed else call())

    def _subscribe(self, key: str, take: Take, depth: int, history: int) -> None:
        def take_if_open(sample: zenoh.Sample, received_ns: int) -> None:
            if not self._closed:
                take(sample, received_ns)

        made = Subscriber(key, take_if_open, depth, history, self.counters)
        self._declare(lambda session: made.declare(session, self.post, self.submit))

    def _query(
        self, key: str, payload: bytes | None, answers: Answers[Any], timeout_s: float
    ) -> None:
        if self._session is None:
            answers.fail("not connected to a router")
            return
        callback = zenoh.handlers.Callback(answers.queue, answers.end)
        self._session.get(
            key, callback, payload=payload, timeout=timeout_s, congestion_control=QUERY_CONGESTION
        )

    def _queryable(self, key: str, take: Callable[[zenoh.Query], None]) -> None:
        def declare(session: zenoh.Session) -> None:
            queryable = session.declare_queryable(key, zenoh.handlers.RingChannel(QUERIES))
            self._queries.append((queryable, take))

        self._declare(declare)
