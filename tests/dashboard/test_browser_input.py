"""Gamepads, keystrokes and the delay of the link in a real browser, at a simulated safety."""

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page

from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import BROWSER_MARKS, take_control, text, wait_for_text
from verification.harness.dashboard import Server
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS

# Readings of gamepads at times in ms, as the page takes them: axes, deadman, time stamp.
READ = """(rows) => import('/t2/gamepad.js').then((it) => rows.map((row) => {
  const pads = row.pads.map((pad) => ({
    connected: true, mapping: 'standard', id: 'pad', index: 0, timestamp: row.at, ...pad,
    buttons: Array.from({ length: 17 }, (_, i) => ({ pressed: i === 4 && pad.deadman, value: 0 })),
  }));
  return it.read(pads, row.at);
}))"""
CENTER = [0.0, 0.0, 0.0, 0.0]
AHEAD = [0.0, -0.8, 0.0, 0.0]
TREMOR = [0.0, -0.8000001, 0.0, 0.0]
TRIGGERS = [0.0, 0.0, -1.0, -1.0]  # they rest at -1, where others have a stick


def pad(axes: list[float], deadman: object = True, **fields: object) -> dict[str, object]:
    return {"axes": axes, "deadman": deadman, **fields}


def read(page: Page, *rows: tuple[int, list[dict[str, object]]]) -> list[dict[str, Any]]:
    """Return the page's judgement of these gamepads at these times in ms."""
    result: list[dict[str, Any]] = page.evaluate(
        READ, [{"at": at, "pads": pads} for at, pads in rows]
    )
    return result


@pytest.fixture
def page(page_of_peer: Page) -> Page:
    return page_of_peer


@pytest.fixture
def driver(page: Page) -> Page:
    """A page with control."""
    take_control(page)
    return page


UP, DOWN = pad(CENTER, deadman=False), pad(CENTER)


def test_a_frozen_gamepad_ends_after_2_s_until_its_deadman_was_up(page: Page) -> None:
    found = read(
        page,
        (0, [UP]),
        (10, [DOWN]),
        (20, [pad(AHEAD)]),  # and never again; its time stamp goes on
        (1020, [pad(AHEAD)]),
        (1021, [pad(AHEAD)]),
        (2020, [pad(AHEAD)]),
        (2021, [pad(AHEAD)]),
        (9000, [pad(TREMOR)]),  # it is back, and was not let go
        (9010, [pad(AHEAD, deadman=False)]),
        (9020, [pad(AHEAD)]),
    )
    driven = [bool(one["push"] and one["push"]["x"]) for one in found]
    assert driven == [False, False, True, True, True, True, False, False, False, True]
    states = [one["state"] for one in found]
    assert states == ["", "", "", "", "still", "still", "frozen", "frozen", "", ""]


def test_the_last_digit_of_an_axis_is_a_living_gamepad(page: Page) -> None:
    rows = [(20 + 1500 * n, [pad((AHEAD, TREMOR)[n % 2], timestamp=0)]) for n in range(10)]
    found = read(page, (0, [UP]), (10, [DOWN]), *rows)
    assert all(one["push"]["x"] > 0.7 for one in found[2:])


def test_an_axis_counts_once_it_was_near_its_centre(page: Page) -> None:
    found = read(
        page,
        (0, [pad(TRIGGERS, deadman=False)]),
        (10, [pad(TRIGGERS)]),
        (20, [pad([0.0, -0.8, -1.0, -1.0])]),
        (30, [pad(CENTER)]),
        (40, [pad(TRIGGERS)]),
    )
    assert [(one["push"] or {}).get("y") for one in found] == [None, 0, 0, 0, 1]
    assert found[2]["push"]["x"] > 0.7


def test_the_gamepad_whose_deadman_is_pressed_drives_and_is_named(page: Page) -> None:
    keyboard = pad([], deadman=False, mapping="", id="media keys", index=0)
    other = pad(CENTER, deadman=False, id="first", index=1)
    mine: dict[str, object] = {"id": "second", "index": 2}
    found = read(
        page,
        (0, [keyboard, other, pad(CENTER, deadman=False, **mine)]),
        (10, [keyboard, other, pad(AHEAD, **mine)]),
        (20, [keyboard, other]),  # gone, without an event
        (30, [keyboard, other, pad(AHEAD, **mine)]),  # back, with the deadman pressed
        (40, [keyboard, other, pad(AHEAD, id="third", index=2)]),  # another one in its place
        (50, [keyboard]),
    )
    names = [one["name"] for one in found]
    assert names == ["first", "second", "first", "first", "first", "media keys"]
    assert [bool(one["push"]) for one in found] == [False, True, False, False, False, False]
    assert [one["isUsable"] for one in found] == [True] * 5 + [False]


FROZEN = """() => {
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false, value: 0 }));
  const pad = { index: 0, id: 'pad', connected: true, mapping: 'standard', timestamp: 0, buttons };
  navigator.getGamepads = () => [pad, null];
  window.freeze = (deadman, value) => {
    buttons[4].pressed = deadman;
    pad.axes = [0, value, 0, 0];
  };
  window.freeze(false, 0);
}"""


def test_a_gamepad_that_freezes_while_it_drives(driver: Page, peer: Peer) -> None:
    def freeze(deadman: bool, value: float) -> None:
        driver.evaluate("([deadman, value]) => window.freeze(deadman, value)", [deadman, value])

    driver.evaluate(FROZEN)
    wait_for_text(driver, "#gamepad", "pad")
    until_moving(peer, lambda: freeze(True, -0.8), lambda: freeze(False, 0.0))
    wait_for_text(driver, "#hold", "Gamepad frozen")
    wait_until(lambda: peer.zeros() >= 3, "the end of them")


def keystroke(page: Page, kind: str, **fields: object) -> None:
    """Send an event of a keystroke to the page."""
    script = """([kind, fields]) => {
      const event = new KeyboardEvent(kind, { bubbles: true, cancelable: true, ...fields });
      if (fields.keyCode) Object.defineProperty(event, 'keyCode', { value: fields.keyCode });
      document.body.dispatchEvent(event);
    }"""
    page.evaluate(script, [kind, fields])


@pytest.mark.parametrize(
    ("letter", "code"),
    [
        ("e", "KeyE"),
        ("E", ""),
        ("\u0443", "KeyE"),  # Cyrillic, at the place of E
        ("\u0443", ""),
        ("\u03b5", "KeyE"),  # Greek
        ("\u0395", ""),
        ("\uff45", ""),  # full width
        ("\u0415", "KeyT"),  # Cyrillic, which looks like E
        ("Process", "KeyE"),  # an input method composes
        (".", "KeyE"),  # Dvorak
        ("e", "KeyD"),
    ],
)
def test_e_stops_by_its_place_and_by_its_letter(
    page: Page, peer: Peer, letter: str, code: str
) -> None:
    peer.estops.clear()
    keystroke(page, "keydown", key=letter, code=code, isComposing=letter == "Process")
    wait_until(lambda: peer.estops, "the emergency stop")
    confirm_estop(page, peer)


def confirm_estop(page: Page, peer: Peer) -> None:
    peer.latched = ("estop",)
    page.wait_for_function("() => !window.T2Estop.isOpen()")
    peer.wait_for_silence()
    peer.latched = ()


@pytest.mark.parametrize(
    ("letter", "code", "notice"),
    [
        ("\u0436", "Semicolon", "switch the keyboard to Latin"),
        ("\u3042", "Digit9", "switch the keyboard to Latin"),
        ("Unidentified", "", "switch the keyboard to Latin"),
        ("x", "KeyX", "The key x does nothing"),
    ],
)
def test_a_keystroke_without_a_function_says_so(
    page: Page, letter: str, code: str, notice: str
) -> None:
    keystroke(page, "keydown", key=letter, code=code)
    wait_for_text(page, "#toasts", notice)


def until_moving(peer: Peer, press: Callable[[], None], let_go: Callable[[], None]) -> None:
    """Press until requests arrive; a hold lapses when the host stalls."""
    peer.requests.clear()
    for _ in range(20):
        press()
        try:
            wait_until(peer.moving, "requests", patience_s=1)
        except AssertionError:
            let_go()
        else:
            return
    raise AssertionError("never drove")


@pytest.mark.parametrize(("letter", "code"), [("\uff57", ""), ("\u0446", "KeyW"), ("w", "")])
def test_the_other_keystrokes_count_in_every_layout(
    driver: Page, peer: Peer, letter: str, code: str
) -> None:
    def hold(kind: str) -> None:
        keystroke(driver, kind, key=letter, code=code)

    until_moving(peer, lambda: hold("keydown"), lambda: hold("keyup"))
    keystroke(driver, "keydown", key="\u3000", code="")  # a full-width space
    wait_until(lambda: peer.zeros() >= 3, "the end of them")


def test_a_keystroke_that_stops_repeating_was_let_go(driver: Page, peer: Peer) -> None:
    def press() -> None:
        for repeat in (False, True):
            keystroke(driver, "keydown", key="w", code="KeyW", repeat=repeat)

    until_moving(peer, press, lambda: keystroke(driver, "keyup", key="w", code="KeyW"))
    wait_until(lambda: peer.zeros() >= 3, "the end of them")
    wait_for_text(driver, "#hold", "Not held")


SLOW = """(delay) => {
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (text) { setTimeout(() => send.call(this, text), delay); };
  const { set } = Object.getOwnPropertyDescriptor(WebSocket.prototype, 'onmessage');
  Object.defineProperty(WebSocket.prototype, 'onmessage', { set(call) {
    set.call(this, (event) => setTimeout(() => call(event), delay));
  } });
}"""


@pytest.mark.parametrize("delay_ms", [250, 600])
def test_on_a_slow_link_a_hold_says_why_it_does_nothing(
    page: Page, server: Server, peer: Peer, delay_ms: int
) -> None:
    page.add_init_script(f"({SLOW})({delay_ms})")
    page.goto(server.url)
    wait_for_text(page, "#verdict", "RUN")
    take_control(page)
    page.keyboard.down("w")
    wait_for_text(page, "#hold", "Link too slow: ")
    assert "limit 0.35 s" in text(page, "#hold")
    delay_s = float(text(page, "#delay-value").split()[0])
    assert delay_s >= 2 * delay_ms / 1000  # rounded to 0.01 s
    assert page.get_attribute("#delay", "data-tone") == "late"
    page.keyboard.up("w")
    wait_for_text(page, "#hold", "Not held")
    if delay_ms > 500:  # safety would refuse a reset, too, and a repetition cannot help
        peer.latched = ("contact",)
        page.wait_for_selector("#reset.due")
        page.keyboard.press("r")
        wait_for_text(page, "#toasts", "limit 1.00 s")
        peer.latched = ()
