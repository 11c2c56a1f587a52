"""Simulated bus, the processes and sources on it: one thread, simulated time.

A process stands in for ``common.service.Node``. Messages are delivered as Python objects:
MessagePack and Zenoh are tested elsewhere.
"""

import heapq
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol, TypeVar

from msgspec.structs import replace

from common.bus.bus import Arrival
from common.freshness import NS_PER_S
from common.loop import Timer
from t2.keys import SAFETY, Call, Topic
from t2.messages import Message, Phrase, SourceMessage
from t2.words import render

MS = NS_PER_S // 1000
ECHO_MS, HOLD_MS = 30, 45  # later than the first copy; later than its neighbours
ROBOT = "001"
SESSION_LEASE_MS = 1000
ROUTES = ("drive", "limit/pendant", "limit", "motion", "state")
M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Disturbance of a route: delay, loss, duplicates; counts mean every n-th message, 0 none."""

    late_ms: int = 0
    lose: int = 0
    double: int = 0
    hold: int = 0  # delayed so that later ones overtake it

    def delays_ms(self, count: int) -> list[int]:
        """Return the delays of the copies of the ``count``-th message; none when it is lost."""
        if self.lose and count % self.lose == 0:
            return []
        held = HOLD_MS if self.hold and count % self.hold == 0 else 0
        first = self.late_ms + held
        return [first, first + ECHO_MS] if self.double and count % self.double == 0 else [first]


CLEAR = Disturbance()


@dataclass(frozen=True, slots=True)
class Envelope:
    """One message in transit."""

    key: str
    message: Message
    sender: int  # ``boot`` of the process that sent it
    private: bool = False  # also sent on the drive link


@dataclass(slots=True)
class Subscription:
    """One subscription; during a stall of its owner it queues the newest messages."""

    owner: "Process"
    key: str
    take: Callable[[Envelope], None]
    depth: int
    private: bool = False  # receives from the drive link only
    waiting: deque[Envelope] = field(default_factory=deque)

    def hand_over(self, envelope: Envelope) -> None:
        """Deliver to the owner, now or after its stall."""
        lost = self.owner.stalled and self.owner.cut and not self.private
        if lost or not self.owner.alive:
            return
        self.waiting.append(envelope)
        while len(self.waiting) > self.depth:
            self.waiting.popleft()
        self.drain()

    def drain(self) -> None:
        """Deliver the queued messages, unless the owner is stalled."""
        while self.waiting and not self.owner.stalled:
            self.take(self.waiting.popleft())


@cache
def matches(expression: str, key: str) -> bool:
    """Return whether a key expression matches a key; ``*`` is one chunk."""
    mine, others = expression.split("/"), key.split("/")
    pairs = zip(mine, others, strict=False)
    return len(mine) == len(others) and all(one in ("*", other) for one, other in pairs)


@cache
def route_of(key: str) -> str:
    """Return the route of a key, for its disturbance."""
    return next((name for name in ROUTES if f"/{name}" in key), "streams")


class Net:
    """Delivers envelopes to subscriptions; while it is down only the drive link delivers."""

    def __init__(self, now_ns: int) -> None:
        self.now_ns = now_ns
        self.up = True
        self.connections = 1  # since the start
        self.disturbances: dict[str, Disturbance] = {}
        self.subscriptions: list[Subscription] = []
        self._readers: dict[str, list[Subscription]] = {}  # by key
        self._under_way: list[tuple[int, int, Subscription, Envelope]] = []  # by the due time
        self._counts: Counter[str] = Counter()
        self._order = 0

    @property
    def connection(self) -> int:
        """Number of the connection to the router; 0 without one."""
        return self.connections if self.up else 0

    def put(self, envelope: Envelope) -> None:
        """Send an envelope to all matching subscriptions, under the disturbance of its route."""
        route = route_of(envelope.key)
        disturbance = self.disturbances.get(route, CLEAR)
        for subscription in self._readers_of(envelope.key):
            reached = envelope.private if subscription.private else self.up
            if reached and subscription.owner.alive:
                self._counts[route] += 1
                for delay_ms in disturbance.delays_ms(self._counts[route]):
                    self._order += 1
                    due_ns = self.now_ns + delay_ms * MS
                    heapq.heappush(self._under_way, (due_ns, self._order, subscription, envelope))

    def subscribe(self, subscription: Subscription) -> None:
        self.subscriptions.append(subscription)
        self._readers.clear()

    def _readers_of(self, key: str) -> list[Subscription]:
        if key not in self._readers:
            self._readers[key] = [it for it in self.subscriptions if matches(it.key, key)]
        return self._readers[key]

    def turn(self) -> None:
        """Deliver everything that is due."""
        while self._under_way and self._under_way[0][0] <= self.now_ns:
            _, _, subscription, envelope = heapq.heappop(self._under_way)
            if self.up or subscription.private:
                subscription.hand_over(envelope)

    def wake(self, owner: "Process") -> None:
        """Deliver what queued up during the stall of a process."""
        for subscription in self.subscriptions:
            if subscription.owner is owner:
                subscription.drain()


class Caller:
    """Stores the answer to a call; ``done`` is None without one."""

    def __init__(self) -> None:
        self.done: bool | None = None
        self.answer: Any = None
        self.text = ""

    def reply(self, message: Any) -> None:
        self.done, self.answer = True, message

    def refuse(self, *reasons: Phrase) -> None:
        self.done, self.text = False, render(reasons)


class Watch(Protocol):
    """Observes all envelopes: when sent, and before their receiver handles them."""

    def on_put(self, process: "Process", envelope: Envelope) -> None: ...

    def on_delivery(self, process: "Process", envelope: Envelope) -> None: ...


class Publisher:
    """Stamps messages as the real one does."""

    passed_on = True  # every key reaches every subscription here

    def __init__(self, process: "Process", key: str, private: bool) -> None:
        self._key = key
        self._process = process
        self._private = private
        self._seq = 0

    def put(self, message: M, raw: bytes | None = None) -> M:
        """Send a message to all subscriptions."""
        self._seq += 1
        now_ns, boot = self._process.net.now_ns, self._process.boot
        sent = replace(message, seq=self._seq, boot=boot, mono_ns=now_ns)
        self._process.send(Envelope(self._key, sent, boot, self._private))
        return sent


class DriveEnd:
    """One end of the drive link; independent of the router."""

    def __init__(self, process: "Process") -> None:
        self._process = process

    def publisher(self, topic: Topic[Any], **names: str) -> Publisher:
        """Return a publisher for the link and the bus."""
        return Publisher(self._process, topic.on(ROBOT, **names), private=True)

    def subscribe(
        self,
        topic: Topic[Any],
        handler: Any,
        *,
        depth: int = 1,
        post: object = None,
        **names: str,
    ) -> None:
        """Call the handler for each message of the other end."""
        self._process.subscribe(topic, handler, depth=depth, private=True, **names)


class Loop:
    """Timers and sockets, stepped by the stack."""

    def __init__(self, net: Net) -> None:
        self._net = net
        self._timers: list[Timer] = []
        self._sockets: list[Callable[[int], None]] = []

    def defer(self, call: Callable[[], object]) -> None:
        """Do nothing: a simulated process takes what it is sent."""

    def every(self, period_s: float, handler: Callable[[int], None]) -> Timer:
        """Call the handler every period, the first time at once."""
        timer = Timer(round(period_s * 1e9), self._net.now_ns, handler)
        self._timers.append(timer)
        return timer

    def watch(self, sock: object, handler: Callable[[int], None]) -> None:
        """Call the handler when there may be something to read."""
        self._sockets.append(handler)

    def read(self) -> None:
        for handler in self._sockets:
            handler(self._net.now_ns)

    def call_due(self) -> None:
        """Call the timers that are due; a late one once."""
        for timer in self._timers:
            timer.call(self._net.now_ns)


class Silent:
    """Log that discards everything."""

    def __getattr__(self, _: str) -> Callable[..., None]:
        return lambda *_, **__: None


class Process:
    """Node and bus in one."""

    def __init__(self, name: str, net: Net, config: Any, boot: int, watch: Watch) -> None:
        self.name = name
        self.net = net
        self.config = config
        self.boot = boot
        self.robot = ROBOT
        self.alive = True
        self.stalled_until_ns = 0  # 0: it has taken what queued up in its last stall
        self.cut = False  # whether the router has ended its session for a long stall
        self._reconnections = 0
        self.taking: Envelope | None = None  # the envelope being handled
        self.bus = self
        self.drive = DriveEnd(self)
        self.loop = Loop(net)
        self.log = Silent()
        self.counters: Counter[str] = Counter()
        self.calls: dict[str, Callable[[Any, Any], None]] = {}
        self._watch = watch

    @property
    def stalled(self) -> bool:
        return self.net.now_ns < self.stalled_until_ns

    @property
    def connection(self) -> int:
        """Number of the connection to the router; 0 without one."""
        return self.net.connection and self.net.connection + self._reconnections

    def stall(self, duration_ms: int) -> None:
        """Stall; a session that is silent for the bus's lease ends, and is opened again."""
        self.stalled_until_ns = self.net.now_ns + duration_ms * MS
        self.cut = duration_ms > SESSION_LEASE_MS
        self._reconnections += self.cut

    def open_drive(self, *, listens: bool) -> DriveEnd:
        return self.drive

    def publisher(self, topic: Topic[Any], **names: str) -> Publisher:
        return Publisher(self, topic.on(ROBOT, **names), private=False)

    def send(self, envelope: Envelope) -> None:
        """Send an envelope, stamped or forged."""
        self._watch.on_put(self, envelope)
        self.net.put(envelope)

    def post(self, key: str, message: Message) -> None:
        """Send any message on any key as this process."""
        self.send(Envelope(key, message, self.boot))

    def subscribe(
        self,
        topic: Topic[Any],
        handler: Callable[[Arrival[Any]], None],
        *,
        depth: int = 1,
        refused: object = None,
        post: object = None,
        private: bool = False,
        **names: str,
    ) -> None:
        """Call the handler for each message."""
        key = topic.on(ROBOT, **names)
        self._take(
            key,
            lambda it: handler(Arrival(it.message, it.key, self.net.now_ns, None)),
            depth,
            private,
        )

    def on_any(self, key: str, handler: Callable[[int], None]) -> None:
        """Call the handler for anything on a key."""
        self._take(key, lambda _: handler(self.net.now_ns))

    def _take(
        self, key: str, handle: Callable[[Envelope], None], depth: int = 1, private: bool = False
    ) -> None:
        def take(envelope: Envelope) -> None:
            self._watch.on_delivery(self, envelope)
            self.taking = envelope
            handle(envelope)
            self.taking = None

        self.net.subscribe(Subscription(self, key, take, depth, private))

    def announce(self, key: str) -> None:
        """Do nothing: every key reaches every subscription here."""

    def answer(self, key: str, make: Callable[[], bytes], encoding: str) -> None:
        """Do nothing: nobody asks for JSON here."""

    def event(self, name: str, level: str, *phrases: Phrase, **about: object) -> None:
        """Discard events."""

    def serve(self, call: Call[Any, Any], handler: Callable[[Any, Any], None]) -> None:
        self.calls[call.path] = handler

    def call(self, call: Call[Any, Any], request: object) -> Caller:
        """Call this process; it does not answer while dead, stalled or cut off."""
        caller = Caller()
        if self.alive and self.net.up and not self.stalled:
            self.calls[call.path](request, caller)
        return caller

    def turn(self) -> None:
        """Do what is due, unless stalled."""
        if not self.alive or self.stalled:
            return
        self.loop.read()
        if self.stalled_until_ns:
            self.stalled_until_ns = 0
            self.net.wake(self)
        self.loop.call_due()


class Source:
    """Publishes its message 20 times a second, with safety's newest heartbeat as its echo."""

    def __init__(
        self,
        name: str,
        topic: Topic[Any],
        process: Process,
        message: SourceMessage | None = None,
    ) -> None:
        self.process = process
        self.message = message  # None: it is silent
        self.echo = 0
        self._name = name
        self._topic = topic
        self._seq = 0
        process.subscribe(SAFETY, self._listen)

    def _listen(self, arrival: Any) -> None:
        self.echo = arrival.message.heartbeat

    def publish(self) -> None:
        """Publish the message, if there is one."""
        if self.message is not None:
            self.put(replace(self.message, echo=self.echo))

    def put(self, message: SourceMessage, *, name: str = "", step: int = 1) -> None:
        """Put any message, with the next number unless ``step`` says otherwise."""
        self._seq += step
        boot = message.boot or self.process.boot
        key = self._topic.on(ROBOT, source=name or self._name)
        self.process.post(key, replace(message, boot=boot, seq=self._seq))
