"""The screen with a real controller on a bus that never opens, and a clock of the test."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from functools import partial

import pytest
from textual.events import AppBlur, Key
from textual.pilot import Pilot

from common import keys
from common.bus.subscriber import Post
from common.freshness import NS_PER_S
from common.messages import Cause, ReleaseRequest, ResetRequest, Ultrasonic
from services.teleop.app import Panel
from services.teleop.config import Teleop
from services.teleop.controller import Controller
from tests.factories import contact_state, link, safety_state
from tests.teleop.support import FakeNode, answer
from verification.harness.teleop_app import LocalTerminalApp
from verification.harness.waiting import PATIENCE_S


class Screen:
    """A node with its controller and screen."""

    def __init__(self) -> None:
        self.node = FakeNode()
        self.controller = Controller(self.node, self.node.event_log)
        self.ended = False
        self.now_ns = 100 * NS_PER_S
        post: Post = lambda call: call()  # noqa: E731 - the screen's thread is the controller's here
        self.app = LocalTerminalApp(
            self.controller, post, lambda: self.ended, Teleop(), lambda: self.now_ns
        )
        # Independent of the time that this host takes to deliver a key.
        self.app._received_ns = lambda event: self.now_ns  # type: ignore[method-assign]

    def speeds(self, count: int) -> list[float]:
        """Run the controller's ticks and return the requested speeds in order."""
        sent = []
        for _ in range(count):
            before, _ = self.node.requests
            self.answer()
            self.controller.tick(self.now_ns)
            self.now_ns += NS_PER_S // 20
            after, last = self.node.requests
            if after > before and last is not None:
                sent.append(last.linear)
        return sent

    def answer(self) -> None:
        """Simulate a fast terminal, so that keys that the host delayed count."""
        for ago in range(10, 0, -1):
            answer(self.controller, self.now_ns - ago * NS_PER_S // 20)

    def text_of(self, name: str) -> str:
        """Return the text of a panel; empty before it exists."""
        panels = self.app.query(Panel).filter(f"#{name}")
        return "".join(panel.shown.plain for panel in panels if panel.shown)

    @asynccontextmanager
    async def shown(self, size: tuple[int, int] = (80, 24)) -> AsyncIterator[Pilot[None]]:
        async with self.app.run_test(size=size) as pilot:
            self.answer()
            yield pilot


@pytest.fixture
def screen() -> Iterator[Screen]:
    screen = Screen()
    yield screen
    screen.node.loop.close()


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


@pytest.mark.parametrize(
    ("key", "speed"), [("w", 0.2), ("W", 0.2), ("up", 0.2), ("shift+up", 0.2), ("s", -0.2)]
)
def test_a_key_drives_and_then_requests_end(screen: Screen, key: str, speed: float) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press(key)
        sent = screen.speeds(30)
        assert sent[:2] == [0.0, speed]
        assert sent[-4:] == [speed, 0.0, 0.0, 0.0]
        assert len(sent) < 20
        assert screen.speeds(3) == []

    play(screen, act)


def test_keys_make_their_calls(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("e")
        assert screen.node.fake.estops == 1
        tell_contact(screen)
        await until(lambda: "pressed" in screen.text_of("safety"), "the contact on the screen")
        await pilot.press("r")
        assert screen.node.fake.asked == [(keys.RESET.path, ResetRequest(echo=7, causes=(42,)))]
        await pilot.press("f")
        screen.speeds(1)
        held = ReleaseRequest(direction="forward", echo=7)
        assert screen.node.fake.asked[-1] == (keys.RELEASE.path, held)

    play(screen, act)


def tell_contact(screen: Screen) -> None:
    """Simulate a pressed bumper in safety's state."""
    screen.node.fake.deliver(keys.SAFETY, contact_state(), screen.now_ns)
    screen.controller.tick(screen.now_ns)


def test_a_reset_clears_what_the_screen_showed(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        tell_contact(screen)
        await until(lambda: "pressed" in screen.text_of("safety"), "the contact on the screen")
        later = Cause(name="estop", action="brake", age=0.0, text="Stopped.", id=43)
        newest = contact_state(heartbeat=9)
        newest = contact_state(
            heartbeat=9, latched=("contact", "estop"), causes=(*newest.causes, later)
        )
        screen.node.fake.deliver(keys.SAFETY, newest, screen.now_ns)  # not drawn yet
        await pilot.press("r")
        assert screen.node.fake.asked == [(keys.RESET.path, ResetRequest(echo=9, causes=(42,)))]

    play(screen, act)


def test_a_key_carries_its_receive_time(screen: Screen) -> None:
    key = Key("w", "w")
    key.time = time.monotonic() - 3.0
    came_ns = LocalTerminalApp._received_ns(screen.app, key)
    assert (screen.now_ns - came_ns) / NS_PER_S == pytest.approx(3.0, abs=0.5)


def test_a_redraw_that_is_posted_late_keeps_its_time(screen: Screen) -> None:
    posted: list[Callable[[], object]] = []

    async def act(_: Pilot[None]) -> None:
        screen.app._post = posted.append
        screen.app.draw()
        drawn_ns = screen.now_ns
        screen.now_ns += 10 * NS_PER_S
        posted[0]()  # late
        assert screen.controller._drawn_ns == drawn_ns

    play(screen, act)


def test_the_terminal_is_queried_and_its_answer_counts(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        screen.now_ns += 10 * NS_PER_S  # what was answered so far is old
        await until(lambda: not screen.controller.terminal.refusal(screen.now_ns), "an answer")

    play(screen, act)


def test_a_terminal_that_does_not_answer_is_queried_less_often(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(
        LocalTerminalApp, "query_terminal", lambda _, question: asked.append(question)
    )

    async def act(pilot: Pilot[None]) -> None:
        before = len(asked)
        for _ in range(60):
            screen.app.probe()
        assert len(asked) - before in (14, 15, 16)  # ten, then every tenth
        assert asked[-1].startswith("\x1b7\x1b[2;")

    play(screen, act)


def test_refused_keys_are_shown(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        screen.now_ns += 10 * NS_PER_S
        screen.controller.tick(screen.now_ns)
        await until(lambda: "KEYS OFF" in screen.text_of("hints"), "the refusal")

    play(screen, act)


def test_help_opens_and_any_other_key_closes_it(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("question_mark")
        await until(lambda: screen.app.query_one("#help", Panel).display, "the help")
        assert not screen.app.query_one("#events", Panel).display
        assert fits(screen, "help")
        await pilot.press("w")
        await until(lambda: not screen.app.query_one("#help", Panel).display, "its end")
        assert screen.speeds(5)  # the key counts

    play(screen, act)


def test_events_scroll(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        for number in range(30):
            screen.node.event_log.add("safety", "info", f"event {number}.")
        screen.controller.tick(screen.now_ns)
        await until(lambda: "event 29." in screen.text_of("events"), "the newest")
        for _ in range(20):
            await pilot.press("left_square_bracket")
        await until(lambda: "event 9." in screen.text_of("events"), "older ones")
        assert "event 29." not in screen.text_of("events")
        for _ in range(20):
            await pilot.press("right_square_bracket")
        await until(lambda: "event 29." in screen.text_of("events"), "the newest again")

    play(screen, act)


def test_an_unconfirmed_emergency_stop_is_shown_until_it_is_latched(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("e")
        for _ in range(70):
            screen.controller.tick(screen.now_ns)
        await until(lambda: "EMERGENCY STOP NOT CONFIRMED" in screen.text_of("safety"), "it")
        safety = screen.app.query_one("#safety", Panel)
        await until(lambda: safety.content_size.height == 3, "the new layout")
        for name in ("safety", "motion", "around", "hints"):
            await until(partial(fits, screen, name), f"{name} to fit")
        state = safety_state(verdict="brake", latched=("estop",))
        screen.node.fake.deliver(keys.SAFETY, state, received_ns=screen.now_ns)
        screen.controller.tick(screen.now_ns)
        await until(lambda: "NOT CONFIRMED" not in screen.text_of("safety"), "its end")

    play(screen, act)


def fits(screen: Screen, name: str) -> bool:
    """Return whether a panel is shown without clipping."""
    panel, lines = screen.app.query_one(f"#{name}", Panel), screen.text_of(name).split("\n")
    room = panel.content_size
    return (
        screen.app.screen.region.contains_region(panel.region)
        and len(lines) <= room.height
        and max(map(len, lines)) <= room.width
    )


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
def test_a_contact_shows_its_release_without_clipping(
    screen: Screen, size: tuple[int, int]
) -> None:
    async def act(pilot: Pilot[None]) -> None:
        tell_contact(screen)
        await until(lambda: "LATCHED" in screen.text_of("safety"), "the cause")
        for name in ("safety", "motion", "around"):
            await until(partial(fits, screen, name), f"{name} to fit")
        assert "0.12 m left" in screen.text_of("safety")
        refusal = "release refused: " + "the vehicle needs two rows to say why it may not. " * 2
        screen.node.event_log.add("safety", "warning", refusal.strip())
        screen.controller.tick(screen.now_ns)
        await until(
            lambda: " ".join(screen.text_of("events").split())[16:] == refusal.strip(), "all of it"
        )

    play(screen, act, *size)


def test_losing_the_focus_of_the_screen_releases(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("w")
        screen.app.post_message(AppBlur())
        await pilot.pause()
        assert screen.speeds(5) == []

    play(screen, act)


@pytest.mark.parametrize("key", ["q", "Q", "ctrl+c", "ctrl+q"])
def test_quitting_waits_for_the_final_zeros(screen: Screen, key: str) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press(key)
        assert screen.app.is_running
        assert screen.speeds(5) == [0.0] * 3
        screen.ended = True
        await until(lambda: not screen.app.is_running, "the screen to leave")

    play(screen, act)


def test_quitting_twice_does_not_wait(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("q")
        await pilot.press("q")
        await until(lambda: not screen.app.is_running, "the screen to leave")

    play(screen, act)


def test_received_values_are_shown(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        fake = screen.node.fake
        fake.deliver(keys.SAFETY, safety_state(text="Driving, slowly."))
        fake.deliver(keys.LINK, link())
        fake.deliver(
            keys.ULTRASONIC, Ultrasonic(ranges=(1.5, *(None,) * 7), status=("ok", *("fault",) * 7))
        )
        screen.controller.tick(0)
        await until(lambda: "Driving, slowly." in screen.text_of("safety"), "safety's words")
        assert "10.7.5.224:4002" in screen.text_of("motion")
        assert "1.50 m" in screen.text_of("around")
        assert screen.text_of("around").count("fault") == 7
        assert "no router yet" in screen.text_of("header")
        screen.node.event_log.add("safety", "error", "contact")
        screen.controller.tick(0)
        await until(lambda: "contact" in screen.text_of("events"), "the event")

    play(screen, act)


@pytest.mark.parametrize(("size", "rows"), [((80, 24), 11), ((120, 40), 13)])
def test_the_screen_fits_and_grows(screen: Screen, size: tuple[int, int], rows: int) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await until(
            lambda: len(screen.text_of("around").split("\n")) == rows, f"a drawing of {rows} rows"
        )
        for panel in screen.app.query(Panel):
            assert screen.app.screen.region.contains_region(panel.region), panel.id
        assert (
            screen.text_of("motion").count("\n")
            < screen.app.query_one("#motion").content_size.height
        )

    play(screen, act, *size)
