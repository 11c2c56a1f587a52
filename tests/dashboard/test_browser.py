"""Roles, stories and faults on the page in a real browser, with the whole stack."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from sim.requests import Driver, Freeze
from tests.dashboard.page import (
    BROWSER_MARKS,
    center_of,
    drive_until_moving,
    open_page,
    phone_of,
    reset_all,
    take_control,
    text,
    wait_for_standstill,
    wait_for_text,
)
from verification.harness.dashboard import Server, dashboard
from verification.harness.stack import RunningStack

pytestmark = BROWSER_MARKS


@pytest.fixture(scope="module")
def server(stack: RunningStack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with dashboard(stack.endpoint, tmp_path_factory.mktemp("server")) as it:
        yield it


@pytest.fixture
def page(browser: Browser, server: Server) -> Iterator[Page]:
    """The page on a desktop, connected."""
    page = browser.new_page(viewport={"width": 1440, "height": 900}, locale="en-GB")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on(
        "console",
        lambda it: problems.append(it.text) if "Content Security Policy" in it.text else None,
    )
    # The robot has no internet: everything has to come from here.
    here = (server.url, server.url.replace("http", "ws"), "data:", "blob:")
    page.on("request", lambda it: None if it.url.startswith(here) else problems.append(it.url))
    open_page(page, server)
    yield page
    page.close()
    assert problems == []


def test_the_content_of_the_page(page: Page) -> None:
    take_control(page)
    reset_all(page)  # a stall of the host may have latched a cause
    page.click("#leave")
    wait_for_text(page, "#verdict", "STOP")
    wait_for_text(page, "#sentence", "No command to drive.")
    wait_for_text(page, "#driver", "No driver")
    wait_for_text(page, "#bumper", "clear")
    assert page.locator("#sonar-view .sector[data-tone=clear]").count() == 8  # an empty world
    wait_for_text(page, "#events", "The board is connected.")
    page.keyboard.down("w")  # without control; it says so while it is held
    wait_for_text(page, "#hold", "Take control first.")
    page.keyboard.up("w")
    page.wait_for_function("() => !document.querySelector('#hold').textContent")
    assert not page.is_visible("#services")  # an operator does not need it
    page.click("#technical summary")
    for service in ("bridge", "safety", "odom", "dashboard"):
        page.wait_for_selector(f"tr[data-service={service}][data-state=alive]")
    wait_for_text(page, "#ultrasonic_brake", "on")
    page.click("#robots summary")
    assert page.get_attribute("#robots a", "href") == "/?robot=001"
    page.click("#language")
    wait_for_text(page, "#verdict", "停止")
    wait_for_text(page, "#sentence", "没有行驶指令")


def test_a_driver_holds_a_key_and_a_viewer_stops(
    browser: Browser, page: Page, server: Server, stack: RunningStack
) -> None:
    context, phone, _ = phone_of(browser, server, "zh-CN")
    page.fill("#name", "Anna")
    page.press("#name", "Enter")  # leaves the field
    take_control(page)
    page.keyboard.press("3")
    wait_for_text(page, "#top", "0.50")
    drive_until_moving(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
    wait_for_text(page, "#driver", "You drive")
    wait_for_text(phone, "#driver", "Anna 正在驾驶")
    phone.tap("#estop")
    wait_for_standstill(stack)
    wait_for_text(page, "#verdict", "BRAKE")
    wait_for_text(phone, "#causes", "急停")
    wait_for_text(page, "#events", "Emergency stop by viewer")
    page.keyboard.up("w")
    context.close()
    reset_all(page)
    wait_for_text(page, "#verdict", "STOP")


def test_a_fault_that_is_still_present_is_not_reset_in_chinese_either(
    page: Page, stack: RunningStack
) -> None:
    page.click("#language")
    stack.control.do(Driver(side="left", bits=4))
    wait_for_text(page, "#sentence", "左侧电机驱动器报告：编码器。原因仍然存在：请先排除，再复位。")
    stack.control.do(Driver(side="left", bits=0))
    wait_for_text(page, "#sentence", "复位后方可行驶。")
    take_control(page)
    reset_all(page)


def test_without_a_board_the_page_names_the_own_switch(page: Page, stack: RunningStack) -> None:
    stack.control.do(Freeze(seconds=8.0))
    wait_for_text(page, "#sentence", "The vehicle may still move: use its own switch.")
    wait_for_text(page, "#detail", "The board is silent")
    page.wait_for_selector("#take:disabled")
    wait_for_text(page, "#link", "Board: up")
    take_control(page)
    reset_all(page)


def test_driving_by_touch_and_a_second_finger_stops(
    browser: Browser, server: Server, stack: RunningStack
) -> None:
    context, phone, finger = phone_of(browser, server, "en-GB")
    take_control(phone)
    x, y, way = center_of(phone, "#stick")
    stop = center_of(phone, "#estop")[:2]

    def press() -> None:
        finger("touchStart", (x, y))
        finger("touchMove", (x, y - way))

    drive_until_moving(stack, press, lambda: finger("touchEnd"))
    finger("touchStart", (x, y - way), stop)
    finger("touchMove", (x, y - way), (stop[0] + 40, stop[1]))  # it slides: never a click
    wait_for_text(phone, "#causes", "Emergency stop.")
    finger("touchEnd")
    wait_for_standstill(stack)
    reset_all(phone)
    context.close()


PAD = """() => {
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false }));
  window.pad = {
    connected: true, mapping: 'standard', index: 1, id: 'A pad', buttons, axes: [0, 0, 0, 0],
  };
  window.pad.buttons[4].pressed = true;
  // Its triggers are axes that rest at -1, where the standard mapping has a stick.
  const odd = { ...window.pad, mapping: '', index: 0, id: 'An odd one', axes: [0, 0, -1] };
  navigator.getGamepads = () => [odd, window.pad];
}"""


def test_driving_by_gamepad(page: Page, stack: RunningStack) -> None:
    def deadman(down: bool) -> None:
        page.evaluate("down => { window.pad.buttons[4].pressed = down; }", down)
        page.wait_for_timeout(200)  # the page looks at it with each snapshot

    take_control(page)
    page.evaluate(PAD)
    wait_for_text(page, "#gamepad", "A pad")
    page.wait_for_timeout(200)
    assert text(page, "#hold") == "Not held"  # it was down when it was found
    deadman(False)
    tremor = (
        "() => { setInterval(() => { window.pad.axes[1] = -0.99 - Math.random() / 200; }, 50); }"
    )
    page.evaluate(tremor)
    drive_until_moving(stack, lambda: deadman(True), lambda: deadman(False))
    page.evaluate("() => { window.pad.mapping = ''; }")
    wait_for_standstill(stack)
    wait_for_text(page, "#gamepad", "cannot drive: the browser does not know its buttons")


HIDDEN = """() => {
  Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
  document.dispatchEvent(new Event('visibilitychange'));
}"""
# The last one leaves the page hidden.
LOST = (
    "window.dispatchEvent(new Event('blur'))",
    "window.dispatchEvent(new Event('contextmenu'))",  # the key to a menu
    HIDDEN,
)


def test_a_page_that_loses_its_input_lets_go(page: Page, stack: RunningStack) -> None:
    take_control(page)
    for script in LOST:
        drive_until_moving(stack, lambda: page.keyboard.down("s"), lambda: page.keyboard.up("s"))
        page.evaluate(script)
        wait_for_standstill(stack)
        page.keyboard.down("s")  # a repeat: the key never came up
        wait_for_text(page, "#hold", "Not held")
        wait_for_standstill(stack)
        page.keyboard.up("s")


def test_the_server_is_lost_and_comes_back(page: Page, server: Server, stack: RunningStack) -> None:
    take_control(page)
    drive_until_moving(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
    server.kill()
    wait_for_standstill(stack)
    wait_for_text(page, "#verdict", "NO CONNECTION")
    wait_for_text(page, "#sentence", "use its own switch")
    wait_for_text(page, "#detail", "What you hold does not reach the robot")
    wait_for_text(page, "#fault", "dashboard run: t2 doctor --robot 001 --set bus.connect=")
    assert not page.is_visible("#fault p")
    page.click("#estop")
    wait_for_text(page, "#unsent", "NOT SENT YET: no connection. It is sent if")
    server.start()
    wait_for_text(page, "#link", "Board: up")
    wait_for_text(page, "#causes", "Emergency stop.")
    page.wait_for_function("() => !document.querySelector('#unsent').textContent")
    wait_for_standstill(stack)
    page.keyboard.up("w")
    take_control(page)
    reset_all(page)
