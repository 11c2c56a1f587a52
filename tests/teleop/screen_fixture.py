"""A screen with a real controller on a bus that never opens, and a clock of the test."""

import asyncio
import re
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

from textual.events import CursorPosition
from textual.pilot import Pilot

from common.freshness import NS_PER_S
from common.loop import Post
from services.teleop.app import Panel, TeleopApp
from services.teleop.config import Teleop
from services.teleop.controller import Controller
from services.teleop.labels import Labels
from t2 import keys
from t2.words import Language
from tests.factories import contact_state
from tests.teleop.inputs import answer
from tests.teleop.support import TeleopNode
from verification.harness.waiting import PATIENCE_S


class LocalTerminalApp(TeleopApp):
    """The screen of a local terminal, which answers each query at once."""

    def query_terminal(self, query: str) -> None:
        """Answer like a terminal."""
        if place := re.search(r"\[(\d+);(\d+)H", query):
            row, column = map(int, place.groups())
            self.post_message(CursorPosition(column - 1, row - 1))


class Screen:
    """A node with its controller and screen."""

    def __init__(self, language: Language = "en") -> None:
        self.node = TeleopNode()
        self.controller = Controller(self.node, self.node.event_log)
        self.ended = False
        self.now_ns = 100 * NS_PER_S
        post: Post = lambda call: call()  # noqa: E731 - the screen's thread is the controller's here
        self.app = LocalTerminalApp(
            self.controller,
            post,
            lambda: self.ended,
            Teleop(),
            Labels(language),
            clock=lambda: self.now_ns,
        )
        # Independent of the time that this host takes to deliver a keystroke.
        self.app._received_ns = lambda event: self.now_ns  # type: ignore[method-assign]

    def speeds(self, count: int) -> list[float]:
        """Run the controller's ticks and return the requested speeds in order."""
        sent = []
        for _ in range(count):
            before, _ = self.node.sent(keys.DRIVE)
            self.answer()
            self.controller.tick(self.now_ns)
            self.now_ns += NS_PER_S // 20
            after, last = self.node.sent(keys.DRIVE)
            if after > before and last is not None:
                sent.append(last.linear)
        return sent

    def answer(self) -> None:
        """Simulate a fast terminal, so that keystrokes that the host delayed count."""
        for ago in range(10, 0, -1):
            answer(self.controller.terminal, self.now_ns - ago * NS_PER_S // 20)

    def tell_contact(self) -> None:
        """Simulate a pressed bumper in safety's state."""
        self.node.fake.deliver(keys.SAFETY, contact_state(), self.now_ns)
        self.controller.tick(self.now_ns)

    def text_of(self, name: str) -> str:
        """Return the text of a panel; empty before it exists."""
        panels = self.app.query(Panel).filter(f"#{name}")
        return "".join(panel.shown.plain for panel in panels if panel.shown)

    @asynccontextmanager
    async def shown(self, size: tuple[int, int] = (80, 24)) -> AsyncIterator[Pilot[None]]:
        async with self.app.run_test(size=size) as pilot:
            self.answer()
            yield pilot


def play(screen: Screen, act: Callable[[Pilot[None]], Awaitable[None]], *size: int) -> None:
    """Run the screen while ``act`` lasts."""

    async def main() -> None:
        async with screen.shown((size[0], size[1]) if size else (80, 24)) as pilot:
            await act(pilot)

    asyncio.run(main())


async def until(true: Callable[[], object], what: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline, f"waited for: {what}"
        await asyncio.sleep(0.01)
