"""A process of the stack as its shell sees it: ``common.service.Node``, but in simulated time."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec

from common.bus.bus import Arrival
from common.keys import Call, Topic
from common.loop import Timer
from common.messages import Message
from tests.invariants.net import Caller, Ear, Letter, Net

ROBOT = "001"
M = TypeVar("M", bound=Message)


class Watch:
    """Sees all letters: when they are put, and before their receiver sees them."""

    def on_put(self, process: "Process", letter: Letter) -> None:
        """A process has put a letter."""

    def on_delivery(self, process: "Process", letter: Letter) -> None:
        """A process is about to take a letter."""


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
        """Send it to all who listen."""
        self._seq += 1
        now_ns, boot = self._process.net.now_ns, self._process.boot
        self.last = msgspec.structs.replace(message, seq=self._seq, boot=boot, mono_ns=now_ns)
        self._process.send(Letter(self.key, self.last, boot, now_ns, self._private))
        return self.last  # type: ignore[no-any-return]


class DriveEnd:
    """One end of the drive link: it takes nothing from the router, and does not need one."""

    def __init__(self, process: "Process") -> None:
        self._process = process

    def publisher(self, topic: Topic[Any], **names: str) -> Publisher:
        """Return a publisher for the link and the bus."""
        return Publisher(self._process, topic, topic.on(ROBOT, **names), private=True)

    def subscribe(self, topic: Topic[Any], handler: Any, *, depth: int = 1, **names: str) -> None:
        """Call the handler for each message of the other end."""
        self._process.subscribe(topic, handler, depth=depth, private=True, **names)


class Loop:
    """Timers and sockets, turned by hand."""

    def __init__(self, net: Net) -> None:
        self._net = net
        self._timers: list[Timer] = []
        self._sockets: list[Callable[[int], None]] = []

    def every(self, period_s: float, handler: Callable[[int], None]) -> Timer:
        """Call it every period, the first time at once."""
        timer = Timer(round(period_s * 1e9), self._net.now_ns, handler)
        self._timers.append(timer)
        return timer

    def watch(self, sock: object, handler: Callable[[int], None]) -> None:
        """Call it when there may be something to read."""
        self._sockets.append(handler)

    def read(self) -> None:
        """Let the sockets be read."""
        for handler in self._sockets:
            handler(self._net.now_ns)

    def call_due(self) -> None:
        """Call the timers that are due; a late one once."""
        for timer in self._timers:
            timer.call(self._net.now_ns)


class Silent:
    """A log that nobody reads."""

    def __getattr__(self, _: str) -> Callable[..., None]:
        return lambda *_, **__: None


class Process:
    """Node and bus in one; as good as dead once it was killed."""

    def __init__(self, name: str, net: Net, config: Any, boot: int, watch: Watch) -> None:
        self.name = name
        self.net = net
        self.config = config
        self.boot = boot
        self.alive = True
        self.hung_until_ns = 0
        self.taking: Letter | None = None  # what its code is dealing with right now
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
    def hangs(self) -> bool:
        """Whether it does nothing for now."""
        return self.net.now_ns < self.hung_until_ns

    @property
    def connected(self) -> bool:
        """Whether there is a router."""
        return self.net.up

    def shares_clock(self, message: Message) -> bool:
        """Tell whether a message was stamped on this host."""
        return True

    def open_bus(self) -> "Process":
        """Return a bus; one will do."""
        return self

    def open_drive(self, *, listens: bool) -> DriveEnd:
        """Return the drive link's end."""
        return self.drive

    def publisher(self, topic: Topic[Any], **names: str) -> Publisher:
        """Return a publisher for a topic."""
        return Publisher(self, topic, topic.on(ROBOT, **names), private=False)

    def send(self, letter: Letter) -> None:
        """Put a letter, stamped or forged."""
        self._watch.on_put(self, letter)
        self.net.put(letter)

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

        def take(letter: Letter) -> None:
            with self.dealing_with(letter):
                handler(Arrival(letter.message, letter.key, self.net.now_ns, None))

        self.net.ears.append(Ear(self, topic.on(ROBOT, **names), take, depth, private))

    def on_any(self, key: str, handler: Callable[[int], None]) -> None:
        """Call the handler for anything on a key."""

        def take(letter: Letter) -> None:
            with self.dealing_with(letter):
                handler(self.net.now_ns)

        self.net.ears.append(Ear(self, key, take, 1))

    def announce(self, key: str) -> None:
        """Declare nothing: every key reaches every reader here."""

    def serve(self, call: Call[Any, Any], handler: Callable[[Any, Any], None]) -> None:
        """Answer a call."""
        self.calls[call.path] = handler

    def call(self, call: Call[Any, Any], request: object) -> Caller:
        """Make a call to this process; one that is dead, hung or cut off does not answer."""
        caller = Caller()
        if self.alive and self.net.up and not self.hangs:
            self.calls[call.path](request, caller)
        return caller

    @contextmanager
    def dealing_with(self, letter: Letter) -> Iterator[None]:
        """Remember the letter while it is being dealt with."""
        self._watch.on_delivery(self, letter)
        self.taking = letter
        yield
        self.taking = None

    def event(self, name: str, level: str, text: str, **about: object) -> None:
        """Nobody hears of transitions."""

    def turn(self) -> None:
        """Do what is due, unless it hangs."""
        if not self.alive or self.hangs:
            return
        self.loop.read()
        self.net.wake(self)
        self.loop.call_due()
