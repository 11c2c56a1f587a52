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
from common.bus.bus import Post
from common.freshness import NS_PER_S
from common.messages import Cause, ReleaseRequest, ResetRequest, Ultrasonic
from services.teleop.app import Panel
from services.teleop.config import Teleop
from services.teleop.controller import Controller
from tests.teleop.support import FakeNode, answer, contact_state, link, safety_state
from verification.harness.support import PATIENCE_S
from verification.harness.teleop_app import NearApp


class Bench:
    """A node, its controller and the screen in front of it."""

    def __init__(self) -> None:
        self.node = FakeNode()
        self.controller = Controller(self.node, self.node.event_log)
        self.ended = False
        self.now_ns = 100 * NS_PER_S
        post: Post = lambda call: call()  # noqa: E731 - the screen's thread is the controller's here
        self.app = NearApp(self.controller, post, lambda: self.ended, Teleop(), lambda: self.now_ns)
        # However long this machine takes to hand a key over.
        self.app._received_ns = lambda event: self.now_ns  # type: ignore[method-assign]

    def speeds(self, count: int) -> list[float]:
        """Let the controller's clock tick, and return the speeds asked for, in order."""
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
        """Let the terminal have been near, so that a key counts that the machine held up."""
        for ago in range(10, 0, -1):
            answer(self.controller, self.now_ns - ago * NS_PER_S // 20)

    def words(self, name: str) -> str:
        """Return what a panel shows; nothing before it is there."""
        panels = self.app.query(Panel).filter(f"#{name}")
        return "".join(panel.shown.plain for panel in panels if panel.shown)

    @asynccontextmanager
    async def shown(self, size: tuple[int, int] = (80, 24)) -> AsyncIterator[Pilot[None]]:
        async with self.app.run_test(size=size) as pilot:
            self.answer()
            yield pilot


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.node.loop.close()


def play(bench: Bench, act: Callable[[Pilot[None]], Awaitable[None]], *size: int) -> None:
    """Run the screen while ``act`` lasts."""

    async def main() -> None:
        async with bench.shown((size[0], size[1]) if size else (80, 24)) as pilot:
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
def test_a_key_drives_and_silence_follows(bench: Bench, key: str, speed: float) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press(key)
        sent = bench.speeds(30)
        assert sent[:2] == [0.0, speed]
        assert sent[-4:] == [speed, 0.0, 0.0, 0.0]
        assert len(sent) < 20
        assert bench.speeds(3) == []

    play(bench, act)


def test_calls_are_made_by_their_keys(bench: Bench) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("e")
        assert bench.node.fake.estops == 1
        tell_contact(bench)
        await until(lambda: "pressed" in bench.words("safety"), "the contact on the screen")
        await pilot.press("r")
        assert bench.node.fake.asked == [(keys.RESET.path, ResetRequest(echo=7, causes=(42,)))]
        await pilot.press("f")
        bench.speeds(1)
        held = ReleaseRequest(direction="forward", echo=7)
        assert bench.node.fake.asked[-1] == (keys.RELEASE.path, held)

    play(bench, act)


def tell_contact(bench: Bench) -> None:
    """Let safety report a pressed bumper."""
    bench.node.fake.tell(keys.SAFETY, contact_state(), bench.now_ns)
    bench.controller.tick(bench.now_ns)


def test_a_reset_clears_what_the_screen_showed(bench: Bench) -> None:
    async def act(pilot: Pilot[None]) -> None:
        tell_contact(bench)
        await until(lambda: "pressed" in bench.words("safety"), "the contact on the screen")
        later = Cause(name="estop", action="brake", age=0.0, text="Stopped.", id=43)
        newest = contact_state(heartbeat=9)
        newest = contact_state(
            heartbeat=9, latched=("contact", "estop"), causes=(*newest.causes, later)
        )
        bench.node.fake.tell(keys.SAFETY, newest, bench.now_ns)  # not drawn yet
        await pilot.press("r")
        assert bench.node.fake.asked == [(keys.RESET.path, ResetRequest(echo=9, causes=(42,)))]

    play(bench, act)


def test_a_key_carries_the_time_when_it_came(bench: Bench) -> None:
    key = Key("w", "w")
    key.time = time.monotonic() - 3.0
    came_ns = NearApp._received_ns(bench.app, key)
    assert (bench.now_ns - came_ns) / NS_PER_S == pytest.approx(3.0, abs=0.5)


def test_a_screen_that_hung_was_not_watched_meanwhile(bench: Bench) -> None:
    posted: list[Callable[[], object]] = []

    async def act(_: Pilot[None]) -> None:
        bench.app._post = posted.append
        bench.app.draw()
        drawn_ns = bench.now_ns
        bench.now_ns += 10 * NS_PER_S
        posted[0]()  # late
        assert bench.controller._drawn_ns == drawn_ns

    play(bench, act)


def test_the_terminal_is_asked_and_its_answer_counts(bench: Bench) -> None:
    async def act(pilot: Pilot[None]) -> None:
        bench.now_ns += 10 * NS_PER_S  # what was answered so far is old
        await until(lambda: not bench.controller.terminal.refusal(bench.now_ns), "an answer")

    play(bench, act)


def test_a_terminal_that_does_not_answer_is_asked_less_often(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(NearApp, "query_terminal", lambda _, question: asked.append(question))

    async def act(pilot: Pilot[None]) -> None:
        before = len(asked)
        for _ in range(60):
            bench.app.probe()
        assert len(asked) - before in (14, 15, 16)  # ten, then every tenth
        assert asked[-1].startswith("\x1b7\x1b[2;")

    play(bench, act)


def test_keys_that_do_not_count_are_said_to(bench: Bench) -> None:
    async def act(pilot: Pilot[None]) -> None:
        bench.now_ns += 10 * NS_PER_S
        bench.controller.tick(bench.now_ns)
        await until(lambda: "KEYS OFF" in bench.words("hints"), "the refusal")

    play(bench, act)


def fits(bench: Bench, name: str) -> bool:
    """Return whether nothing of a panel is cut off."""
    panel, lines = bench.app.query_one(f"#{name}", Panel), bench.words(name).split("\n")
    room = panel.content_size
    return (
        bench.app.screen.region.contains_region(panel.region)
        and len(lines) <= room.height
        and max(map(len, lines)) <= room.width
    )


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
def test_a_contact_makes_room_for_its_release(bench: Bench, size: tuple[int, int]) -> None:
    async def act(pilot: Pilot[None]) -> None:
        tell_contact(bench)
        await until(lambda: "LATCHED" in bench.words("safety"), "the cause")
        for name in ("safety", "motion", "around"):
            await until(partial(fits, bench, name), f"{name} to fit")
        assert "0.12 m left" in bench.words("safety")
        refusal = "release refused: " + "the vehicle needs two rows to say why it may not. " * 2
        bench.node.event_log.add("safety", "warning", refusal.strip())
        bench.controller.tick(bench.now_ns)
        await until(
            lambda: " ".join(bench.words("events").split())[16:] == refusal.strip(), "all of it"
        )

    play(bench, act, *size)


def test_the_focus_is_the_hold(bench: Bench) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("w")
        bench.app.post_message(AppBlur())
        await pilot.pause()
        assert bench.speeds(5) == []

    play(bench, act)


@pytest.mark.parametrize("key", ["q", "Q", "ctrl+c", "ctrl+q"])
def test_leaving_waits_for_the_last_zeros(bench: Bench, key: str) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press(key)
        assert bench.app.is_running
        assert bench.speeds(5) == [0.0] * 3
        bench.ended = True
        await until(lambda: not bench.app.is_running, "the screen to leave")

    play(bench, act)


def test_leaving_twice_does_not_wait_for_a_desk_that_hangs(bench: Bench) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("q")
        await pilot.press("q")
        await until(lambda: not bench.app.is_running, "the screen to leave")

    play(bench, act)


def test_what_is_known_is_shown(bench: Bench) -> None:
    async def act(pilot: Pilot[None]) -> None:
        fake = bench.node.fake
        fake.tell(keys.SAFETY, safety_state(text="Driving, slowly."))
        fake.tell(keys.LINK, link())
        fake.tell(
            keys.ULTRASONIC, Ultrasonic(ranges=(1.5, *(None,) * 7), status=("ok", *("fault",) * 7))
        )
        bench.controller.tick(0)
        await until(lambda: "Driving, slowly." in bench.words("safety"), "safety's words")
        assert "10.7.5.224:4002" in bench.words("motion")
        assert "1.50 m" in bench.words("around")
        assert bench.words("around").count("fault") == 7
        assert "no router yet" in bench.words("header")
        bench.node.event_log.add("safety", "error", "contact")
        bench.controller.tick(0)
        await until(lambda: "contact" in bench.words("events"), "the event")

    play(bench, act)


@pytest.mark.parametrize(("size", "rows"), [((80, 24), 11), ((120, 40), 13)])
def test_it_fits_and_grows(bench: Bench, size: tuple[int, int], rows: int) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await until(
            lambda: len(bench.words("around").split("\n")) == rows, f"a drawing of {rows} rows"
        )
        for panel in bench.app.query(Panel):
            assert bench.app.screen.region.contains_region(panel.region), panel.id
        assert (
            bench.words("motion").count("\n") < bench.app.query_one("#motion").content_size.height
        )

    play(bench, act, *size)
