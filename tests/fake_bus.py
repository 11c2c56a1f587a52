"""A bus without a router: records what is published and called, and injects messages."""

from collections.abc import Callable
from typing import Any, TypeVar

from msgspec import Struct

from common import clock
from common.bus.bus import Arrival, Bus
from common.config import Loaded
from common.service import Node
from common.settings import Shared
from t2.keys import Call, Topic
from t2.messages import Message, Refusal
from verification.harness.bus import at

C = TypeVar("C", bound=Shared)


class FakeBus(Bus):
    """A bus that never opens."""

    def __init__(self) -> None:
        self.handlers: dict[str, list[Callable[[Arrival[Any]], None]]] = {}
        self.served: dict[str, Callable[[Any, Any], None]] = {}
        self.asked: list[tuple[str, Any]] = []
        self.answers: list[tuple[Callable[[Any], None], Callable[[Refusal], None]]] = []
        self.estops = 0
        super().__init__(at("tcp/127.0.0.1:1"), "001", lambda call: call())

    def subscribe(self, topic: Topic[Any], handler: Any, **names: Any) -> None:
        """Store the handler for ``deliver``; the queue is ignored."""
        names = {name: one for name, one in names.items() if name not in {"depth", "post"}}
        self.handlers.setdefault(topic.on(self.robot, **names), []).append(handler)

    def serve(self, call: Call[Any, Any], handler: Any) -> None:
        """Store the handler of a call."""
        self.served[call.path] = handler

    def call(
        self, call: Call[Any, Any], request: Struct, on_reply: Any, on_refusal: Any,
        timeout_s: float = 2.0,
    ) -> None:  # fmt: skip
        """Store the request and the handlers of its answer."""
        self.asked.append((call.path, request))
        self.answers.append((on_reply, on_refusal))

    def estop(self) -> None:
        """Count the stop."""
        self.estops += 1

    def deliver(
        self,
        topic: Topic[Any],
        message: Message,
        received_ns: int | None = None,
        declared: str = "",
        **names: str,
    ) -> None:
        """Inject a message, by default now; ``declared`` is the handler's key if it has a *."""
        key = topic.on(self.robot, **names)
        now_ns = clock.now_ns() if received_ns is None else received_ns
        for handler in self.handlers[declared or key]:
            handler(Arrival(message, key, now_ns, None))


class FakeNode(Node[C]):
    """A node on a ``FakeBus``; its loop does not run."""

    def __init__(self, name: str, config: C) -> None:
        self.events: list[str] = []
        super().__init__(name, Loaded(config, {}))

    def open_bus(self) -> FakeBus:
        """Return the fake."""
        self.fake = FakeBus()
        return self.fake

    def event(self, name: Any, *args: Any, **about: Any) -> None:
        """Record the name of an event, and publish it."""
        self.events.append(name)
        super().event(name, *args, **about)

    def sent(self, topic: Topic[Any]) -> tuple[int, Any]:
        """Return the number of messages sent on a topic, and the last one."""
        publisher = next(each for each in self.bus.publishers if each.topic is topic)
        return publisher._seq, publisher.last
