"""The screen: keys, queries of the terminal, what is shown and that it fits, and its end."""

import time
from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace
from rich.cells import cell_len
from textual.events import AppBlur, Key
from textual.pilot import Pilot

from common.freshness import NS_PER_S
from services.teleop.app import Panel
from t2 import keys
from t2.messages import Cause, Event, Phrase, Phrases, ResetRequest, Ultrasonic
from tests.factories import contact_state, link, safety_state
from tests.fake_bus import FakeBus
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


def test_losing_the_focus_of_the_screen_lets_go(screen: Screen) -> None:
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
            screen.app.query_cursor()
        assert len(asked) - 1 in (14, 15, 16, 17)  # ten, then every tenth
        assert asked[-1].startswith("\x1b7\x1b[2;")
        screen.now_ns += 10 * NS_PER_S
        screen.controller.tick(screen.now_ns)
        await until(lambda: "KEYBOARD OFF" in screen.text_of("hints"), "the refusal")
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


@pytest.mark.parametrize("alarm", [(), (Phrase("event.estop_unconfirmed"),)])
@pytest.mark.parametrize("size", [(80, 24), (100, 32)])
def test_the_safety_panel_shows_all_its_rows_and_hides_no_other(
    screen: Screen, size: tuple[int, int], alarm: Phrases, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(type(screen.controller), "_alarm", lambda *_: alarm)
    still = "The bumper was hit. The vehicle must stand: move off first, then reset it here."

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
        screen.node.event_log.add("safety", "error", (), "contact")
        screen.controller.tick(0)
        await until(lambda: "Driving, slowly." in screen.text_of("safety"), "safety's words")
        assert "10.7.5.224:4002" in screen.text_of("motion")
        assert "not connected" in screen.text_of("header")
        assert "contact" in screen.text_of("events")
        assert "1.50 m" in screen.text_of("around")
        assert screen.text_of("around").count("fault") == 7

    play(screen, act)


# --- Chinese --------------------------------------------------------------------------------


def phrased(cause: str, *phrases: Phrase) -> Cause:
    return Cause(name=cause, action="stop", age=3.0, text="text", phrases=phrases)  # type: ignore[arg-type]


STILL_PRESSED = (Phrase("contact"), Phrase("next.move_off"))
SITUATIONS: dict[str, tuple[dict[str, Any], tuple[Phrase, ...], list[str]]] = {
    "stopped": (
        {"verdict": "stop", "text": "-", "phrases": (Phrase("no_request"),)},
        (),
        ["停止  没有行驶指令。"],
    ),
    "unconfirmed": (
        {"text": "-", "phrases": (Phrase("control.of", {"source": "web"}),)},
        (Phrase("event.estop_unconfirmed"), Phrase("estop.repeated", {"seconds": 27.0})),
        ["急停未被确认：请使用车身上的急停开关。将继续发送 27 秒。", " 运行  由网页（web）控制。"],
    ),
    "contact": (
        {
            "verdict": "brake",
            "latched": ("contact",),
            "release": contact_state().release,
            "text": "-",
            "phrases": STILL_PRESSED,
            "causes": (
                phrased("contact", Phrase("contact")),
                phrased("silent", Phrase("silent.old", {"inputs": ("velocity", "bumper")})),
            ),
        },
        (),
        [
            "制动  防撞条已触发。防撞条仍被压下：请先脱离，再复位。",
            "脱离碰撞  推断可脱离：后退（12 秒前前进，净 +0.43 m）",
            " F  前进    B  后退   复位前剩余 0.12 m",
            "须复位 碰撞 3 秒  停止 数据过旧 3 秒",
        ],
    ),
}


@pytest.mark.parametrize("screen", ["zh"], indirect=True)
@pytest.mark.parametrize("name", SITUATIONS)
def test_the_screen_in_chinese_fits_80_columns(
    screen: Screen, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fields, alarm, expected = SITUATIONS[name]
    monkeypatch.setattr(type(screen.controller), "_alarm", lambda *_: alarm)
    monkeypatch.setattr(FakeBus, "connected", True)
    event = Event(name="contact", level="error", text="-", phrases=(Phrase("event.contact"),))

    async def act(pilot: Pilot[None]) -> None:
        fake, now_ns = screen.node.fake, screen.now_ns
        fake.deliver(keys.SAFETY, safety_state(**fields), now_ns)
        waiting = (Phrase("waiting.neutral"),)
        fake.deliver(keys.LINK, link(armed=False, waiting="-", waiting_phrases=waiting), now_ns)
        everyone = keys.EVENTS.on("001", service="*")
        fake.deliver(keys.EVENTS, event, declared=everyone, service="bridge")
        screen.controller.tick(now_ns)
        screen.app.draw()
        await pilot.pause()
        screen.app.draw()
        await pilot.pause()
        assert screen.text_of("safety").strip().split("\n") == expected
        assert "桥接服务  防撞条已触发：已发送制动指令。" in screen.text_of("events")
        assert "主控板  等待零速指令" in screen.text_of("motion")
        assert "E 急停" in screen.text_of("hints")
        for panel in screen.app.query(Panel):
            assert panel.shown is not None
            rows = panel.shown.plain.split("\n")
            assert max(map(cell_len, rows)) <= panel.content_size.width, rows
        titles = {panel.border_title for panel in screen.app.query(Panel)}
        assert titles == {None, "安全", "四周", "运动", "事件"}

    play(screen, act)
