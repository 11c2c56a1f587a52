"""Speed limits and the keepalive of the emergency stop, shown in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import Limit, SafetyState
from tests.dashboard.page import (
    BROWSER_MARKS,
    reset_all,
    take_control,
    wait_for_text,
)
from verification.harness.bus import bus_on, running
from verification.harness.dashboard import dashboard
from verification.harness.stack import RunningStack, running_stack

pytestmark = BROWSER_MARKS

SETS = ('safety.limits.lidar={lease=1.0, silence="ignore"}', 'safety.estop_keepalive=["web"]')


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    with running_stack(tmp_path_factory.mktemp("stack"), sets=SETS) as it:
        yield it


@pytest.fixture
def page(browser: Browser, stack: RunningStack, tmp_path: Path) -> Iterator[Page]:
    sets = ("dashboard.round_trip=1.0", "dashboard.estop_keepalive=web")
    with dashboard(stack.endpoint, tmp_path, *sets) as server:
        page = browser.new_page(locale="en-GB", viewport={"width": 1440, "height": 900})
        page.goto(server.url)
        yield page
        page.close()


class Lidar:
    """Repeats a cap of 0.1 m/s, or a protective stop."""

    def __init__(self, loop: Loop) -> None:
        self.cap = 0.1
        self.heartbeat = 0
        self._loop = loop

    def declare(self, bus: Bus) -> None:
        limits = bus.publisher(keys.LIMIT, source="lidar")

        def hear(arrival: Arrival[SafetyState]) -> None:
            self.heartbeat = arrival.message.heartbeat

        def publish(_: int) -> None:
            reason, echo = "person at 2 m", self.heartbeat
            limits.put(Limit(linear=self.cap, angular=None, reason=reason, echo=echo))

        bus.subscribe(keys.SAFETY, hear)

        self._loop.post(lambda: self._loop.every(0.1, publish))


def test_a_limit_is_shown_with_its_reason(page: Page, stack: RunningStack) -> None:
    wait_for_text(page, "#keeper", "This page keeps the emergency stop alive")
    take_control(page)
    page.keyboard.press("5")
    with running(Loop()) as loop:
        lidar = Lidar(loop)
        with bus_on(stack.endpoint, loop, lidar.declare):
            wait_for_text(page, "#limits", "0.10")
            page.keyboard.down("w")
            wait_for_text(page, "#causes", "lidar: person at 2 m")
            wait_for_text(page, "#verdict", "SLOW")
            lidar.cap = 0.0
            wait_for_text(page, "#verdict", "STOP")
            wait_for_text(page, "#causes", "lidar: person at 2 m")
            page.click("#language")
            wait_for_text(page, "#causes", "lidar: person at 2 m")
            page.screenshot(path=stack.log.with_name("limit.png"))
    page.keyboard.up("w")


def test_a_page_in_the_background_no_longer_keeps_the_stop_alive(
    page: Page, stack: RunningStack
) -> None:
    wait_for_text(page, "#keeper", "This page keeps the emergency stop alive")
    take_control(page)
    page.evaluate(
        "Object.defineProperty(document, 'hidden', { configurable: true, get: () => true })"
    )
    wait_for_text(page, "#verdict", "BRAKE")
    wait_for_text(page, "#causes", "no longer kept alive")
    page.screenshot(path=stack.log.with_name("keepalive.png"))
    page.evaluate("Object.defineProperty(document, 'hidden', { get: () => false })")
    wait_for_text(page, "#keeper", "This page keeps the emergency stop alive")
    reset_all(page)
    wait_for_text(page, "#verdict", "STOP")
