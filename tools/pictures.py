"""``python -m tools.pictures``: screenshots of the terminal and the dashboard for the docs.

Both drive the simulated vehicle through the real services; chromium takes the screenshots.
"""

import asyncio
import re
import tempfile
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

from common.config import Sources, load
from common.service import Node
from services.teleop.config import TeleopConfig
from services.teleop.controller import Controller
from services.teleop.event_log import EventLog
from services.teleop.gamepad import find
from sim.requests import Place
from verification.harness.bus import running
from verification.harness.dashboard import dashboard
from verification.harness.dashboard_page import CHROMIUM, open_page, take_control
from verification.harness.stack import RunningStack, running_stack
from verification.harness.teleop_app import LocalTerminalApp
from verification.harness.waiting import wait_until

IMAGES = Path("docs/images")
COLUMNS, ROWS = 104, 34
GEAR, REPEAT_S, HELD, HELD_MS = "4", 0.05, 32, 2000  # presses of W; ms


def main() -> None:
    """Renew both screenshots."""
    with tempfile.TemporaryDirectory() as folder, running_stack(Path(folder), "office") as stack:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            picture_dashboard(stack, browser, Path(folder))
            browser.close()
        stack.control.do(Place(x=0.0, y=0.0))
        screen = asyncio.run(terminal_screen(stack))
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            picture_terminal(screen, browser)
            browser.close()


async def terminal_screen(stack: RunningStack) -> str:
    """Drive from a terminal and return its screen as SVG."""
    sets = [f"bus.connect={stack.endpoint}", "teleop.gamepad=false"]
    node = Node("teleop", load(TeleopConfig, Sources(sets=sets)))
    controller = Controller(node, EventLog())
    node.announce()
    controller.use_gamepad(find(node.config.teleop))
    app = LocalTerminalApp(controller, node.loop.post, lambda: False, node.config.teleop)
    with running(node.loop):
        node.bus.open()
        async with app.run_test(size=(COLUMNS, ROWS)) as pilot:
            while controller.view.safety is None or controller.view.safety.verdict == "inhibited":
                await pilot.pause(REPEAT_S)
            await pilot.press(GEAR)
            for _ in range(HELD):
                await pilot.press("w")
                await pilot.pause(REPEAT_S)
            screen = app.export_screenshot(title="t2 drive")
        node.bus.close()
    return re.sub(r"@font-face \{.*?\}", "", screen, flags=re.DOTALL)  # the fonts are remote


def picture_terminal(screen: str, browser: Browser) -> None:
    """Save the screenshot of the terminal."""
    page = browser.new_page(viewport={"width": 1300, "height": 900})
    page.set_content(screen)
    page.locator("svg").screenshot(path=IMAGES / "drive.png", omit_background=True)
    page.close()


def picture_dashboard(stack: RunningStack, browser: Browser, folder: Path) -> None:
    """Drive with the page's keys and save its screenshot."""
    with dashboard(stack.endpoint, folder) as server:
        page = browser.new_page(viewport={"width": 1440, "height": 900}, locale="en-GB")
        open_page(page, server)
        take_control(page)
        page.keyboard.press(GEAR)
        page.keyboard.down("w")
        wait_until(lambda: stack.speed() > 0.1, "the vehicle moves")
        page.keyboard.down("a")
        page.wait_for_timeout(HELD_MS)
        page.screenshot(path=IMAGES / "dashboard.png")
        page.close()


if __name__ == "__main__":
    main()
