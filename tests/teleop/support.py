"""A node without a network: records what it publishes and calls, and injects messages."""

import time
from collections.abc import Callable
from typing import Any

from msgspec import Struct

from common import keys
from common.bus.bus import Arrival, Bus
from common.config import Loaded
from common.freshness import NS_PER_S
from common.keys import Call, Topic
from common.messages import Drive, Message
from common.motion import Twist
from common.service import Node
from services.teleop.config import TeleopConfig
from services.teleop.controller import Controller
from services.teleop.event_log import EventLog
from services.teleop.view import View
from verification.harness.bus import at


class FakeBus(Bus):
    """A bus that never opens."""

    def __init__(self, *args: Any) -> None:
        self.handlers: dict[str, list[Callable[[Arrival[Any]], None]]] = {}
        self.asked: list[tuple[str, Any]] = []
        self.answers: list[tuple[Callable[[Any], None], Callable[[str], None]]] = []
        self.estops = 0
        super().__init__(*args)

    def subscribe(self, topic: Topic[Any], handler: Any, **names: Any) -> None:
        """Store the handler for ``deliver``; the depth is ignored."""
        names.pop("depth", None)
        self.handlers.setdefault(topic.on(self.robot, **names), []).append(handler)

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
        now_ns = time.monotonic_ns() if received_ns is None else received_ns
        for handler in self.handlers[declared or key]:
            handler(Arrival(message, key, now_ns, None))


class FakeNode(Node[TeleopConfig]):
    """A node on a ``FakeBus``; its logs go to an event log, its loop does not run."""

    def __init__(self, **settings: Any) -> None:
        self.event_log = EventLog()
        config = TeleopConfig()
        super().__init__("teleop", Loaded(config, {}))
        self.event_log.capture_logs(config.log)

    def open_bus(self) -> FakeBus:
        """Return the fake."""
        self.fake = FakeBus(at("tcp/127.0.0.1:1"), "001", lambda call: call())
        return self.fake

    @property
    def requests(self) -> tuple[int, Drive | None]:
        """The number of drive requests sent, and the last one."""
        publisher = next(p for p in self.bus.publishers if p.topic is keys.DRIVE)
        return publisher.next_seq - 1, publisher.last


def view(**fields: Any) -> View:
    """Return a view that knows nothing yet, but for the given fields."""
    usual: dict[str, Any] = {
        "robot": "001",
        "source": "teleop",
        "connected": True,
        "gear": 1,
        "turbo": False,
        "top": Twist(0.2, 0.3),
    }
    return View(**usual | fields)


def answer(controller: Controller, now_ns: int) -> None:
    """Simulate a terminal that answers at once."""
    controller.terminal.sent(0, now_ns - NS_PER_S // 1000)
    controller.terminal.answered(0, now_ns)
