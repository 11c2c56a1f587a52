"""Moving off a pressed bumper, and E-STOP without the socket, in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from tests.dashboard.bus_fixture import World
from tests.dashboard.servers import FREE, NEWER, Servers, serving
from verification.harness.dashboard import Site, dashboard
from verification.harness.dashboard_page import CHROMIUM, middle, shows, takes
from verification.harness.waiting import wait_until

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def patient(
    endpoint: str, world: World, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Site]:
    folder: Path = tmp_path_factory.mktemp("patient")
    sets = ("dashboard.round_trip=1.0", "dashboard.call_round_trip=2.0")
    with dashboard(endpoint, folder, *sets) as site:
        yield site


@pytest.fixture
def servers(endpoint: str, world: World) -> Iterator[Servers]:
    with serving(endpoint, world) as it:
        yield it


@pytest.fixture
def page(browser: Browser, patient: Site, servers: Servers) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1280, "height": 800}, locale="en-GB")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(patient.url)
    shows(page, "#causes", "The bumper was hit.")
    yield page
    page.close()
    assert problems == []


def directions(servers: Servers) -> set[str | None]:
    return {one.direction for one in servers.releases if one.held}


def test_the_operator_chooses_the_direction(page: Page, servers: Servers) -> None:
    takes(page)
    shows(page, "#release-free", "Backward is believed free: the last motion was forward 0.40 m")
    shows(page, "#release-left", "0.15 m")
    x, y, _ = middle(page, "#release-backward")
    page.mouse.move(x, y)
    page.mouse.down()
    wait_until(lambda: directions(servers) == {"backward"}, "calls backward")
    page.mouse.up()
    wait_until(lambda: not servers.releases[-1].held, "the end of them")
    servers.releases.clear()
    page.keyboard.down("f")
    wait_until(lambda: directions(servers) == {"forward"}, "calls forward")
    page.keyboard.up("f")
    wait_until(lambda: not servers.releases[-1].held, "the end of them")


def test_a_direction_that_is_forbidden_is_let_go_and_disabled(page: Page, servers: Servers) -> None:
    takes(page)
    page.keyboard.down("b")
    wait_until(lambda: directions(servers) == {"backward"}, "calls backward")
    servers.world.release = msgspec.structs.replace(FREE, forbidden=("backward",), left=0.02)
    wait_until(lambda: not servers.releases[-1].held, "the end of them")
    shows(page, "#release-forbidden", "Backward is forbidden until a reset")
    assert page.is_disabled("#release-backward")
    assert page.is_enabled("#release-forward")
    page.click("#language")
    shows(page, "#release-forbidden", "复位前禁止后退")
    page.click("#language")
    page.keyboard.up("b")
    servers.releases.clear()
    page.keyboard.press("b")
    shows(page, "#toasts", "Backward is forbidden")
    assert servers.releases == []


def test_a_watcher_cannot_release(page: Page, servers: Servers) -> None:
    page.keyboard.press("b")
    shows(page, "#toasts", "Take the wheel first.")
    assert page.is_disabled("#release-backward")
    assert servers.releases == []


def test_a_reset_answers_what_is_on_the_screen(page: Page, servers: Servers) -> None:
    takes(page)
    servers.boot += 1
    servers.is_effective = False
    servers.world.causes = (NEWER,)
    shows(page, "#causes", "0.1 s")
    page.click("#reset")
    shows(page, "#toasts", "RESET NOT CONFIRMED")
    assert servers.resets[0].causes == (NEWER.id,)


def test_an_emergency_stop_goes_out_without_the_socket(page: Page, servers: Servers) -> None:
    page.evaluate("() => { WebSocket.prototype.send = () => {}; }")
    servers.world.estops.clear()
    page.click("#estop")
    wait_until(lambda: servers.world.estops, "the emergency stop")
    servers.world.latched = ("contact", "estop")
