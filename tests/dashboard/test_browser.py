"""The page in a real browser, before the whole stack and the simulated vehicle."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from sim.requests import Driver
from verification.harness.dashboard import Site, dashboard
from verification.harness.dashboard_page import (
    CHROMIUM,
    drives,
    middle,
    opened,
    phone_of,
    resets,
    shows,
    stands,
    takes,
    text,
)
from verification.harness.stack import RunningStack, running_stack

# Alone: a browser that shares the machine answers so late that the hand lapses.
pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed"),
]


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    with running_stack(tmp_path_factory.mktemp("stack")) as it:
        yield it


@pytest.fixture(scope="module")
def site(stack: RunningStack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    # A browser on a shared machine answers late; what is late is tried in test_server.py.
    with dashboard(
        stack.endpoint, tmp_path_factory.mktemp("site"), "dashboard.round_trip=1.0"
    ) as it:
        yield it


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def page(browser: Browser, site: Site) -> Iterator[Page]:
    """The page on a desktop, connected."""
    page = browser.new_page(viewport={"width": 1440, "height": 900}, locale="en-GB")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on(
        "console",
        lambda it: problems.append(it.text) if "Content Security Policy" in it.text else None,
    )
    # The robot has no internet: everything has to come from here.
    here = (site.url, site.url.replace("http", "ws"), "data:", "blob:")
    page.on("request", lambda it: None if it.url.startswith(here) else problems.append(it.url))
    opened(page, site)
    yield page
    page.close()
    assert problems == []


def test_what_is_on_the_screen(page: Page, stack: RunningStack) -> None:
    shows(page, "#verdict", "STOP")
    shows(page, "#sentence", "No source requests motion.")
    shows(page, "#speed", "0.00")
    shows(page, "#driver", "Nobody drives")
    shows(page, "#bumper", "clear")
    assert page.locator("#around .sector").count() == 8
    assert page.locator("#around .sector[data-tone=clear]").count() == 8  # an empty world
    for service in ("bridge", "safety", "odom", "dashboard"):
        page.wait_for_selector(f"tr[data-service={service}][data-state=alive]")
    shows(page, "#streams", "tel/odom/odometry")
    shows(page, "#ultrasonic_brake", "on")
    stack.control.do(Driver(side="left", bits=1 << 2))
    shows(page, "[data-bit='2']", "Encoder")
    shows(page, "#causes", "left motor driver")
    page.click("#language")
    shows(page, "[data-bit='2']", "编码器")
    shows(page, "#verdict", "停止")
    shows(page, "#sentence", "左侧电机驱动器报告故障")
    page.click("#language")
    stack.control.do(Driver(side="left", bits=0))
    takes(page)
    resets(page)


def test_by_mouse(page: Page, stack: RunningStack) -> None:
    takes(page)
    x, y, way = middle(page, "#stick")

    def press() -> None:
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - way)

    drives(stack, press, page.mouse.up)
    page.wait_for_function("() => Number(document.querySelector('#speed').textContent) > 0.1")
    shows(page, "#driver", "You drive")
    page.mouse.up()
    stands(stack)
    shows(page, "#hold", "Released")


def test_by_keyboard_and_a_lost_focus(page: Page, stack: RunningStack) -> None:
    takes(page)
    page.keyboard.press("3")
    shows(page, "#top", "0.50")
    page.keyboard.press("1")
    drives(stack, lambda: page.keyboard.down("s"), lambda: page.keyboard.up("s"))
    assert stack.speed() < 0
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    stands(stack)
    page.keyboard.down("s")  # a repeat: the key never came up
    shows(page, "#hold", "Released")
    stands(stack)
    page.keyboard.up("s")


def test_a_key_whose_way_up_is_lost(page: Page, stack: RunningStack) -> None:
    takes(page)
    ways: tuple[Callable[[], None], ...] = (
        lambda: page.keyboard.press("Meta"),
        lambda: page.click("h2", button="right"),
    )
    for lose in ways:
        drives(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
        lose()
        shows(page, "#hold", "Released")
        stands(stack)
        page.keyboard.press("Escape")
        page.keyboard.up("w")


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


def test_by_gamepad(page: Page, stack: RunningStack) -> None:
    def deadman(down: bool) -> None:
        page.evaluate("down => { window.pad.buttons[4].pressed = down; }", down)
        page.wait_for_timeout(200)  # the page looks at it with each picture

    takes(page)
    page.evaluate(PAD)
    shows(page, "#gamepad", "A pad")
    page.wait_for_timeout(200)
    assert text(page, "#hold") == "Released"  # it was down when it was found
    deadman(False)
    drives(stack, lambda: deadman(True), lambda: deadman(False))
    page.evaluate("() => { window.pad.mapping = ''; }")
    stands(stack)
    shows(page, "#gamepad", "cannot drive: the browser does not know its buttons: An odd one")


def test_in_the_background(page: Page, stack: RunningStack) -> None:
    takes(page)
    drives(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
    page.evaluate(
        """() => {
          Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
          document.dispatchEvent(new Event('visibilitychange'));
        }"""
    )
    stands(stack)
    page.keyboard.up("w")


def test_by_touch_and_a_stop_from_somebody_who_watches(
    browser: Browser, page: Page, site: Site, stack: RunningStack
) -> None:
    context, phone, finger = phone_of(browser, site, "zh-CN")
    shows(phone, "#link", "主板：在线")
    takes(phone)
    x, y, way = middle(phone, "#stick")

    def press() -> None:
        finger("touchStart", (x, y))
        finger("touchMove", (x, y - way))

    drives(stack, press, lambda: finger("touchEnd"))
    shows(page, "#driver", "drives")
    page.focus("#name")
    page.keyboard.press("Space")
    stands(stack)
    shows(page, "#verdict", "BRAKE")
    shows(phone, "#verdict", "制动")
    shows(phone, "#causes", "紧急停车")
    finger("touchEnd")
    assert phone.is_visible("#estop")
    resets(phone)
    context.close()
    shows(page, "#driver", "Nobody drives")


def test_a_second_finger_stops(browser: Browser, site: Site) -> None:
    context, phone, finger = phone_of(browser, site, "en-GB")
    takes(phone)
    stick = middle(phone, "#stick")[:2]
    stop = middle(phone, "#estop")[:2]
    finger("touchStart", stick)
    finger("touchStart", stick, stop)
    finger("touchMove", stick, (stop[0] + 40, stop[1]))  # it slides: never a click
    shows(phone, "#causes", "Emergency stop.")
    finger("touchEnd")
    resets(phone)
    context.close()


def test_one_tap_stops(page: Page, stack: RunningStack) -> None:
    page.click("#estop")
    shows(page, "#causes", "Emergency stop.")
    shows(page, "#sentence", "Emergency stop.")
    takes(page)
    resets(page)


def test_the_server_is_lost_and_comes_back(page: Page, site: Site, stack: RunningStack) -> None:
    takes(page)
    drives(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
    site.kill()
    stands(stack)
    shows(page, "#verdict", "NO CONNECTION")
    shows(page, "#sentence", "use its own switch")
    site.start()
    shows(page, "#link", "Board: up")
    stands(stack)
    page.keyboard.up("w")


def test_nothing_is_wider_than_the_screen(page: Page) -> None:
    for width in (360, 390, 768, 1440):
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
