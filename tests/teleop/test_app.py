"""The screen: keys, queries of the terminal, what is shown and that it fits, and its end."""

import time
from collections.abc import Callable

import pytest
from msgspec.structs import replace
from textual.events import AppBlur, Key
from textual.pilot import Pilot

from common.freshness import NS_PER_S
from services.teleop.app import Panel
from t2 import keys
from t2.messages import Cause, ResetRequest, Ultrasonic
from tests.factories import contact_state, link, safety_state
from tests.teleop.screen_fixture import LocalTerminalApp, Screen, play, until

# --- keys -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("key", "speed"), [("W", 0.2), ("shift+up", 0.2), ("s", -0.2)])
def test_a_key_drives_and_then_requests_end(screen: Screen, key: str, speed: float) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press(key)
        sent = screen.speeds(30)
        assert sent[:2] == [0.0, speed]
        assert sent[-4:] == [speed, 0.0, 0.0, 0.0]
        assert len(sent) < 20
        assert screen.speeds(3) == []

    play(screen, act)


def test_a_reset_clears_what_the_screen_showed(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        screen.tell_contact()
        await until(lambda: "pressed" in screen.text_of("safety"), "the contact on the screen")
        later = Cause(name="estop", action="brake", age=0.0, text="Stopped.", id=43)
        newest = contact_state(heartbeat=9)
        newest = contact_state(
            heartbeat=9, latched=("contact", "estop"), causes=(*newest.causes, later)
        )
        screen.node.fake.deliver(keys.SAFETY, newest, screen.now_ns)  # not drawn yet
        await pilot.press("r")
        assert screen.node.fake.asked == [(keys.RESET.path, ResetRequest(echo=9, causes=(42,)))]
        await pilot.press("e")
        assert screen.node.fake.estops == 1

    play(screen, act)


def test_a_key_carries_its_receive_time(screen: Screen) -> None:
    key = Key("w", "w")
    key.time = time.monotonic() - 3.0
    came_ns = LocalTerminalApp._received_ns(screen.app, key)
    assert (screen.now_ns - came_ns) / NS_PER_S == pytest.approx(3.0, abs=0.5)


def test_losing_the_focus_of_the_screen_releases(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press("w")
        screen.app.post_message(AppBlur())
        await pilot.pause()
        assert screen.speeds(5) == []

    play(screen, act)


@pytest.mark.parametrize("key", ["q", "ctrl+c"])
def test_quitting_twice_does_not_wait(screen: Screen, key: str) -> None:
    async def act(pilot: Pilot[None]) -> None:
        await pilot.press(key)
        await pilot.press(key)
        await until(lambda: not screen.app.is_running, "the screen to leave")

    play(screen, act)


# --- the terminal ---------------------------------------------------------------------------


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


def test_a_terminal_that_does_not_answer_is_queried_less_often_and_drives_nothing(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(
        LocalTerminalApp, "query_terminal", lambda _, question: asked.append(question)
    )

    async def act(pilot: Pilot[None]) -> None:
        for _ in range(60):
            screen.app.probe()
        assert len(asked) - 1 in (14, 15, 16, 17)  # ten, then every tenth
        assert asked[-1].startswith("\x1b7\x1b[2;")
        screen.now_ns += 10 * NS_PER_S
        screen.controller.tick(screen.now_ns)
        await until(lambda: "KEYS OFF" in screen.text_of("hints"), "the refusal")
        await pilot.press("w")
        screen.controller.tick(screen.now_ns)
        assert screen.node.sent(keys.DRIVE)[0] == 0

    play(screen, act)


# --- panels ---------------------------------------------------------------------------------


def test_a_control_character_reaches_no_panel(screen: Screen) -> None:
    async def act(_: Pilot[None]) -> None:
        screen.node.fake.deliver(keys.SAFETY, hostile, screen.now_ns)
        screen.controller.tick(screen.now_ns)
        screen.app.draw()
        assert "Stopped.\\u001b[2J\\u009b31m" in screen.text_of("safety")

    hostile = replace(contact_state(), text="Stopped.\x1b[2J\x9b31m", release=None)
    play(screen, act)


@pytest.mark.parametrize(
    "alarm", ["", "EMERGENCY STOP NOT CONFIRMED: use the vehicle's own switch"]
)
@pytest.mark.parametrize("size", [(80, 24), (100, 32)])
def test_the_safety_panel_shows_all_its_rows_and_hides_no_other(
    screen: Screen, size: tuple[int, int], alarm: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(type(screen.controller), "_alarm", lambda *_: alarm)
    still = "The bumper was hit. Bumper polls were lost: move off first, then reset it here."

    async def act(pilot: Pilot[None]) -> None:
        screen.node.fake.deliver(keys.SAFETY, contact_state(text=still), screen.now_ns)
        screen.controller.tick(screen.now_ns)
        screen.app.draw()
        await pilot.pause()
        safety, hints = (screen.app.query_one(f"#{name}", Panel) for name in ("safety", "hints"))
        rows = screen.text_of("safety").split("\n")
        assert len(rows) == (3 if size[0] == 80 else 2) + bool(alarm)
        assert safety.content_size.height >= len(rows)
        assert hints.region.bottom == size[1]

    play(screen, act, *size)


def test_received_values_are_shown(screen: Screen) -> None:
    async def act(pilot: Pilot[None]) -> None:
        fake = screen.node.fake
        fake.deliver(keys.SAFETY, safety_state(text="Driving, slowly."))
        fake.deliver(keys.LINK, link())
        fake.deliver(
            keys.ULTRASONIC, Ultrasonic(ranges=(1.5, *(None,) * 7), status=("ok", *("fault",) * 7))
        )
        screen.node.event_log.add("safety", "error", "contact")
        screen.controller.tick(0)
        await until(lambda: "Driving, slowly." in screen.text_of("safety"), "safety's words")
        assert "10.7.5.224:4002" in screen.text_of("motion")
        assert "no router" in screen.text_of("header")
        assert "contact" in screen.text_of("events")
        assert "1.50 m" in screen.text_of("around")
        assert screen.text_of("around").count("fault") == 7

    play(screen, act)
