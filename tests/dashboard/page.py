"""Actions and checks on the page in a browser."""

import shutil
from collections.abc import Callable

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize

from verification.harness.dashboard import Server
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

# The shell without a window takes two thirds of the CPU.
BROWSERS = "chromium-headless-shell", "chromium", "chromium-browser"
CHROMIUM = next(filter(None, map(shutil.which, BROWSERS)), None)
# Alone: a browser on a busy host answers so late that the hold lapses.
BROWSER_MARKS = [
    pytest.mark.timed,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed"),
]
PHONE: ViewportSize = {"width": 390, "height": 844}
STILL_MPS = 0.005


def open_page(page: Page, server: Server) -> None:
    page.goto(server.url)
    wait_for_text(page, "#link", "Board: up")


def text(page: Page, where: str) -> str:
    return page.inner_text(where, timeout=20_000)


def wait_for_text(page: Page, where: str, expected: str) -> None:
    """Wait until an element of the page contains this text."""
    page.wait_for_function(
        "([where, text]) => document.querySelector(where)?.textContent.includes(text)",
        arg=[where, expected],
        timeout=20_000,
    )


def take_control(page: Page) -> None:
    """Take the driver lock, also from another viewer."""
    page.click("#take")
    page.wait_for_function(
        "() => document.querySelector('.is-driver') || document.querySelector('#question').open"
    )
    if page.is_visible("#question-yes"):
        page.click("#question-yes")
    page.wait_for_selector(".driving.is-driver")


def drive_until_moving(
    stack: RunningStack, press: Callable[[], None], let_go: Callable[[], None]
) -> None:
    """Hold until the vehicle moves; let go and retry after a stall of the host."""
    for _ in range(40):
        press()
        try:
            wait_until(lambda: abs(stack.speed()) > 0.1, "the vehicle moves", patience_s=1)
        except AssertionError:
            let_go()
        else:
            return
    raise AssertionError(f"never drove: {stack.log.read_text()[-3000:]}")


def wait_for_standstill(stack: RunningStack) -> None:
    wait_until(lambda: abs(stack.speed()) < STILL_MPS, "the vehicle stands")


def center_of(page: Page, where: str) -> tuple[float, float, float]:
    """Return the centre of an element, and half its height."""
    page.locator(where).scroll_into_view_if_needed()
    box = page.locator(where).bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, box["height"] / 2


def reset_all(page: Page) -> None:
    """Reset until nothing is latched; safety requires that each cause is gone first.

    Where the stick was, the page refuses presses until none came for a while.
    """
    is_due = page.locator("#reset.due").count

    def over() -> bool:
        page.wait_for_timeout(300)
        if not is_due():
            return True
        page.click("#reset")
        page.wait_for_timeout(300)
        if is_due():
            page.wait_for_timeout(1600)
        return False

    wait_until(over, "a reset")


def phone_of(
    browser: Browser, server: Server, locale: str
) -> tuple[BrowserContext, Page, Callable[..., None]]:
    """Return a phone with the page, and a function that sends touch events."""
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True, locale=locale)
    phone = context.new_page()
    phone.goto(server.url)
    phone.wait_for_selector("#robots a", state="attached")
    touch = context.new_cdp_session(phone)

    def finger(kind: str, *points: tuple[float, float]) -> None:
        touch.send(
            "Input.dispatchTouchEvent",
            {"type": kind, "touchPoints": [{"x": x, "y": y} for x, y in points]},
        )

    return context, phone, finger
