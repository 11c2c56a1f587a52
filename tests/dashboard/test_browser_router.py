"""The page without a router, in a real browser."""

import contextlib
from pathlib import Path

from playwright.sync_api import Browser

from tests.dashboard.page import BROWSER_MARKS, take_control, wait_for_text
from verification.harness.bus import router_process
from verification.harness.dashboard import dashboard
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS

WHY = "No connection to the router"


def test_without_a_router_no_control_looks_usable(browser: Browser, tmp_path: Path) -> None:
    where = f"tcp/127.0.0.1:{free_port()}"
    with contextlib.ExitStack() as router, contextlib.ExitStack() as rest:
        router.enter_context(router_process(where))
        server = rest.enter_context(dashboard(where, tmp_path, "dashboard.round_trip=1.0"))
        page = browser.new_page(locale="en-GB")
        rest.callback(page.close)
        page.goto(server.url)
        wait_until(lambda: page.evaluate("!document.body.matches('.stale')"), "snapshots")
        take_control(page)
        assert page.locator("#stick.disabled").count() == 0
        router.close()
        wait_for_text(page, "#verdict", "NO ROUTER")
        wait_until(lambda: page.get_attribute("#reset", "title") == WHY, "the reason")
        assert page.is_disabled("#reset")
        assert page.get_attribute("#stick", "title") == WHY
        assert page.locator("#stick.disabled").count() == 1
