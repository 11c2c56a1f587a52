"""The page in a real browser, with the whole stack and the simulated vehicle."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from sim.requests import Driver
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
from verification.harness.stack import RunningStack, running_stack

pytestmark = BROWSER_MARKS


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    with running_stack(tmp_path_factory.mktemp("stack")) as it:
        yield it


@pytest.fixture(scope="module")
def server(stack: RunningStack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    # A browser on a shared host answers late; test_server.py tests late answers.
    with dashboard(
        stack.endpoint, tmp_path_factory.mktemp("server"), "dashboard.round_trip=1.0"
    ) as it:
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


def test_the_content_of_the_page(page: Page, stack: RunningStack) -> None:
    wait_for_text(page, "#verdict", "STOP")
    wait_for_text(page, "#sentence", "No source requests motion.")
    wait_for_text(page, "#speed", "0.00")
    wait_for_text(page, "#driver", "No driver")
    wait_for_text(page, "#bumper", "clear")
    assert page.locator("#sonar-view .sector").count() == 8
    assert page.locator("#sonar-view .sector[data-tone=clear]").count() == 8  # an empty world
    for service in ("bridge", "safety", "odom", "dashboard"):
        page.wait_for_selector(f"tr[data-service={service}][data-state=alive]")
    wait_for_text(page, "#streams", "tel/odom/odometry")
    wait_for_text(page, "#ultrasonic_brake", "on")
    stack.control.do(Driver(side="left", bits=1 << 2))
    wait_for_text(page, "[data-bit='2']", "Encoder")
    wait_for_text(page, "#causes", "left motor driver")
    page.click("#language")
    wait_for_text(page, "[data-bit='2']", "编码器")
    wait_for_text(page, "#verdict", "停止")
    wait_for_text(page, "#sentence", "左侧电机驱动器报告故障")
    page.click("#language")
    stack.control.do(Driver(side="left", bits=0))
    take_control(page)
    reset_all(page)


def test_driving_by_mouse(page: Page, stack: RunningStack) -> None:
    take_control(page)
    x, y, way = center_of(page, "#stick")

    def press() -> None:
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - way)

    drive_until_moving(stack, press, page.mouse.up)
    page.wait_for_function("() => Number(document.querySelector('#speed').textContent) > 0.1")
    wait_for_text(page, "#driver", "You drive")
    page.mouse.up()
    wait_for_standstill(stack)
    wait_for_text(page, "#hold", "Released")


def test_driving_by_keyboard_and_a_lost_focus(page: Page, stack: RunningStack) -> None:
    take_control(page)
    page.keyboard.press("3")
    wait_for_text(page, "#top", "0.50")
    page.keyboard.press("1")
    drive_until_moving(stack, lambda: page.keyboard.down("s"), lambda: page.keyboard.up("s"))
    assert stack.speed() < 0
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    wait_for_standstill(stack)
    page.keyboard.down("s")  # a repeat: the key never came up
    wait_for_text(page, "#hold", "Released")
    wait_for_standstill(stack)
    page.keyboard.up("s")


PAD = """() => {
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false }));
  window.pad = {
    connected: true, mapping: 'standard', index: 1, id: 'A pad', buttons, axes: [0, -1, 0, 0],
  };
  window.pad.buttons[4].pressed = true;
  // Its triggers are axes that rest at -1, where the standard mapping has a stick.
  const odd = { ...window.pad, mapping: '', index: 0, id: 'An odd one', axes: [0, 0, -1] };
  navigator.getGamepads = () => [odd, window.pad];
}"""


def test_driving_by_gamepad(page: Page, stack: RunningStack) -> None:
    def deadman(down: bool) -> None:
        page.evaluate("down => { window.pad.buttons[4].pressed = down; }", down)
        page.wait_for_timeout(200)  # the page looks at it with each picture

    take_control(page)
    page.evaluate(PAD)
    wait_for_text(page, "#gamepad", "A pad")
    page.wait_for_timeout(200)
    assert text(page, "#hold") == "Released"  # it was down when it was found
    deadman(False)
    drive_until_moving(stack, lambda: deadman(True), lambda: deadman(False))
    page.evaluate("() => { window.pad.mapping = ''; }")
    wait_for_standstill(stack)
    wait_for_text(
        page, "#gamepad", "cannot drive: the browser does not know its buttons: An odd one"
    )


def test_a_page_in_the_background_releases(page: Page, stack: RunningStack) -> None:
    take_control(page)
    drive_until_moving(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
    page.evaluate(
        """() => {
          Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
          document.dispatchEvent(new Event('visibilitychange'));
        }"""
    )
    wait_for_standstill(stack)
    page.keyboard.up("w")


def test_driving_by_touch_and_a_stop_from_another_viewer(
    browser: Browser, page: Page, server: Server, stack: RunningStack
) -> None:
    context, phone, finger = phone_of(browser, server, "zh-CN")
    wait_for_text(phone, "#link", "主板：在线")
    take_control(phone)
    x, y, way = center_of(phone, "#stick")

    def press() -> None:
        finger("touchStart", (x, y))
        finger("touchMove", (x, y - way))

    drive_until_moving(stack, press, lambda: finger("touchEnd"))
    wait_for_text(page, "#driver", "drives")
    page.keyboard.press("Space")  # of a viewer who does not drive
    page.keyboard.press("e")
    wait_for_standstill(stack)
    wait_for_text(page, "#verdict", "BRAKE")
    wait_for_text(phone, "#verdict", "制动")
    wait_for_text(phone, "#causes", "急停")
    finger("touchEnd")
    assert phone.is_visible("#estop")
    reset_all(phone)
    context.close()
    wait_for_text(page, "#driver", "No driver")


def test_a_second_finger_stops(browser: Browser, server: Server) -> None:
    context, phone, finger = phone_of(browser, server, "en-GB")
    take_control(phone)
    stick = center_of(phone, "#stick")[:2]
    stop = center_of(phone, "#estop")[:2]
    finger("touchStart", stick)
    finger("touchStart", stick, stop)
    finger("touchMove", stick, (stop[0] + 40, stop[1]))  # it slides: never a click
    wait_for_text(phone, "#causes", "Emergency stop.")
    finger("touchEnd")
    reset_all(phone)
    context.close()


def test_the_server_is_lost_and_comes_back(page: Page, server: Server, stack: RunningStack) -> None:
    take_control(page)
    drive_until_moving(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
    server.kill()
    wait_for_standstill(stack)
    wait_for_text(page, "#verdict", "NO CONNECTION")
    wait_for_text(page, "#sentence", "use its own switch")
    server.start()
    wait_for_text(page, "#link", "Board: up")
    wait_for_standstill(stack)
    page.keyboard.up("w")
