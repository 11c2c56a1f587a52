"""The checkout's session on the simulated stack, in simulated time: no router, no sleep.

``SimulatedInspector`` stands for Zenoh. The session runs in one thread, so time passes where it
waits for a message.
"""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import msgspec

import cli.inspect.client
from cli.commission.session import CheckoutSession
from common.bus.inspector import Answer, Inspector
from common.config import Setting, flatten
from common.settings import Vehicle
from sim.config import load_plan
from sim.model import Model
from t2 import codec, keys
from t2 import messages as m
from t2.codec import Sample
from tests.simulated_robot import SimulatedTime
from verification.search.bus import ROBOT, Envelope, Subscription
from verification.search.stack import IDEAL, Stack

STEP_MS = 10


class SimulatedInspector(Inspector):
    """The calls of an inspector that a client of safety makes."""

    def __init__(self, stack: Stack) -> None:
        self.doctor, self.left_out = "t2 doctor", 0
        self.stack = stack
        self.waiting: deque[Sample] = deque()
        self.process = stack.process("checkout")
        self.each_step: Callable[[], object] = lambda: None
        self.change: Callable[[m.Message], m.Message] = lambda message: message

    def listen(self, expression: str, *, history: bool = False) -> None:
        def take(envelope: Envelope) -> None:
            message = self.change(envelope.message)
            self.waiting.append(
                Sample(
                    envelope.key, codec.encode(message), codec.encoding(type(message)), False, None,
                    self.stack.net.now_ns, 0,
                )
            )  # fmt: skip

        self.stack.net.subscribe(Subscription(self.process, expression, take, depth=100))

    def take(self, wait_s: float) -> Sample | None:
        left_ms = wait_s * 1000
        while not self.waiting and left_ms > 0:
            self.stack.run(STEP_MS)
            self.each_step()
            left_ms -= STEP_MS
        return self.waiting.popleft() if self.waiting else None

    def queued(self) -> Iterator[Sample]:
        for _ in range(len(self.waiting)):
            yield self.waiting.popleft()

    def put(self, key: str, payload: bytes, *_: Any, **__: Any) -> None:
        kind = m.Drive if "/@cmd/drive/" in key else m.Message
        self.process.post(key, codec.decode(payload or codec.EMPTY, kind))

    def query(
        self, selector: str, payload: bytes | None = None, timeout_s: float = 2.0
    ) -> list[Answer]:
        if selector == keys.RESET.on(ROBOT):
            assert payload is not None
            caller = self.stack.call_reset(codec.decode(payload, m.ResetRequest))
            self.stack.run(50)
            if caller.done:
                return [Answer(selector, codec.encode(caller.answer))]
            return [Answer("", b"", refusal=m.Refusal(text=caller.text))]
        service = selector.split("/")[-2]
        if service not in self.stack.processes:
            return []
        config = self.stack.processes[service].config
        given = {path: Setting(value, "default") for path, value in flatten(config)}
        return [Answer(selector, msgspec.json.encode(given))]


@contextmanager
def simulated_session(model: Model = IDEAL) -> Iterator[tuple[CheckoutSession, SimulatedInspector]]:
    """Yield the session on a stack whose services are up."""
    stack = Stack(model, plan=load_plan("empty", Vehicle()), step_ns=STEP_MS * 1_000_000)
    with ExitStack() as patches:
        patches.enter_context(patch.object(cli.inspect.client, "time", SimulatedTime(stack)))
        patches.enter_context(stack.time())
        inspector = SimulatedInspector(stack)
        session = CheckoutSession(inspector, ROBOT)
        session.listen(2.0)
        yield session, inspector
