"""Process of the stack: stands in for ``common.service.Node``, in simulated time."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec

from common.bus.bus import Arrival
from common.keys import Call, Topic
from common.loop import Timer
from common.messages import Message
from verification.invariants.net import MS, Caller, Envelope, Net, Subscription

ROBOT = "001"
SESSION_LEASE_MS = 1000
M = TypeVar("M", bound=Message)


class Watch:
    """Observes all envelopes: when sent, and before their receiver handles them."""

    def on_put(self, process: "Process", envelope: Envelope) -> None:
        """Observe an envelope that a process sends."""

    def on_delivery(self, process: "Process", envelope: Envelope) -> None:
        """Observe an envelope before a process handles it."""


class Publisher:
    """Stamps messages as the real one does."""

    def __init__(self, process: "Process", topic: Topic[Any], key: str, private: bool) -> None:
        self.key = key
        self.last: Any = None
        self._process = process
        self._private = private
        self._seq = 0

    @property
    def next_seq(self) -> int:
        """The ``seq`` that the next message will carry."""
        return self._seq + 1

    def put(self, message: M, raw: bytes | None = None) -> M:
        """Send a message to all subscriptions."""
        self._seq += 1
        now_ns, boot = self._process.net.now_ns, self._process.boot
        self.last = msgspec.structs.replace(message, seq=self._seq, boot=boot, mono_ns=now_ns)
        self._process.send(Envelope(self.key, self.last, boot, now_ns, self._private))
        return self.last  # type: ignore[no-any-return]


class DriveEnd:
    """One end of the drive link; independent of the router."""

    def __init__(self, process: "Process") -> None:
        self._process = process

    def publisher(self, topic: Topic[Any], **names: str) -> Publisher:
        """Return a publisher for the link and the bus."""
        return Publisher(self._process, topic, topic.on(ROBOT, **names), private=True)

    def subscribe(self, topic: Topic[Any], handler: Any, *, depth: int = 1, **names: str) -> None:
        """Call the handler for each message of the other end."""
        self._process.subscribe(topic, handler, depth=depth, private=True, **names)


class Loop:
    """Timers and sockets, stepped by the test."""

    def __init__(self, net: Net) -> None:
        self._net = net
        self._timers: list[Timer] = []
        self._sockets: list[Callable[[int], None]] = []

    def every(self, period_s: float, handler: Callable[[int], None]) -> Timer:
        """Call the handler every period, the first time at once."""
        timer = Timer(round(period_s * 1e9), self._net.now_ns, handler)
        self._timers.append(timer)
        return timer

    def watch(self, sock: object, handler: Callable[[int], None]) -> None:
        """Call the handler when there may be something to read."""
        self._sockets.append(handler)

    def read(self) -> None:
        """Read all sockets."""
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
        self.stalled_until_ns = 0
        self.cut = False  # whether the router has ended its session for a long stall
        self._reconnections = 0
        self.taking: Envelope | None = None  # the envelope being handled
        self.bus = self
        self.drive = DriveEnd(self)
        self.loop = Loop(net)
        self.log = Silent()
        self.counters: Counter[str] = Counter()
        self.calls: dict[str, Callable[[Any, Any], None]] = {}
        self.is_stopped: Callable[[], bool] = lambda: True
        self.on_exit: Callable[[], None] = lambda: None
        self.timing: Callable[[], object] = lambda: None
        self._watch = watch

    @property
    def stalled(self) -> bool:
        """Whether the process is stalled."""
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

    def shares_clock(self, message: Message) -> bool:
        """Return whether a message was stamped on this host."""
        return True

    def open_bus(self) -> "Process":
        """Return a bus; the same one."""
        return self

    def open_drive(self, *, listens: bool) -> DriveEnd:
        """Return the drive link's end."""
        return self.drive

    def publisher(self, topic: Topic[Any], **names: str) -> Publisher:
        """Return a publisher for a topic."""
        return Publisher(self, topic, topic.on(ROBOT, **names), private=False)

    def send(self, envelope: Envelope) -> None:
        """Send an envelope, stamped or forged."""
        self._watch.on_put(self, envelope)
        self.net.put(envelope)

    def subscribe(
        self,
        topic: Topic[Any],
        handler: Callable[[Arrival[Any]], None],
        *,
        depth: int = 1,
        refused: object = None,
        known: object = (),
        private: bool = False,
        **names: str,
    ) -> None:
        """Call the handler for each message."""

        def take(envelope: Envelope) -> None:
            with self.handling(envelope):
                handler(Arrival(envelope.message, envelope.key, self.net.now_ns, None))

        self.net.subscriptions.append(
            Subscription(self, topic.on(ROBOT, **names), take, depth, private)
        )

    def on_any(self, key: str, handler: Callable[[int], None]) -> None:
        """Call the handler for anything on a key."""

        def take(envelope: Envelope) -> None:
            with self.handling(envelope):
                handler(self.net.now_ns)

        self.net.subscriptions.append(Subscription(self, key, take, 1))

    def announce(self, key: str) -> None:
        """Do nothing: every key reaches every subscription here."""

    def answer(self, key: str, make: Callable[[], bytes], encoding: str) -> None:
        """Do nothing: nobody asks for JSON here."""

    def serve(self, call: Call[Any, Any], handler: Callable[[Any, Any], None]) -> None:
        """Register the handler of a call."""
        self.calls[call.path] = handler

    def call(self, call: Call[Any, Any], request: object) -> Caller:
        """Call this process; it does not answer while dead, stalled or cut off."""
        caller = Caller()
        if self.alive and self.net.up and not self.stalled:
            self.calls[call.path](request, caller)
        return caller

    @contextmanager
    def handling(self, envelope: Envelope) -> Iterator[None]:
        """Record the envelope while it is being handled."""
        self._watch.on_delivery(self, envelope)
        self.taking = envelope
        yield
        self.taking = None

    def event(self, name: str, level: str, text: str, **about: object) -> None:
        """Discard events."""

    def turn(self) -> None:
        """Do what is due, unless stalled."""
        if not self.alive or self.stalled:
            return
        self.loop.read()
        self.net.wake(self)
        self.loop.call_due()
