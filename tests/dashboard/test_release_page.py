"""Moving off a pressed bumper, and E-STOP without the socket, in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from playwright.sync_api import Browser, Page

from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import CHROMIUM, center_of, take_control, wait_for_text
from tests.dashboard.servers import FREE, NEWER, CallServers
from verification.harness.dashboard import Server, dashboard
from verification.harness.waiting import wait_until

pytestmark = [
    pytest.mark.timed,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed"),
]


@pytest.fixture(scope="module")
def patient(
    endpoint: str, peer: Peer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    folder: Path = tmp_path_factory.mktemp("patient")
    sets = ("dashboard.round_trip=1.0", "dashboard.call_round_trip=2.0")
    with dashboard(endpoint, folder, *sets) as server:
        yield server


@pytest.fixture
def page(browser: Browser, patient: Server, calls: CallServers) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1280, "height": 800}, locale="en-GB")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(patient.url)
    wait_for_text(page, "#causes", "The bumper was hit.")
    yield page
    page.close()
    assert problems == []


def has_ended(calls: CallServers) -> bool:
    return calls.peer.requests[-1].release == "none"


def test_the_operator_chooses_the_direction(page: Page, calls: CallServers) -> None:
    take_control(page)
    wait_for_text(
        page, "#release-free", "Backward is believed free: the last motion was forward 0.40 m"
    )
    wait_for_text(page, "#release-left", "0.15 m")
    x, y, _ = center_of(page, "#release-backward")
    page.mouse.move(x, y)
    page.mouse.down()
    wait_until(lambda: calls.releases() == {"backward"}, "requests backward")
    page.mouse.up()
    wait_until(lambda: has_ended(calls), "the end of them")
    calls.peer.requests.clear()
    page.keyboard.down("f")
    wait_until(lambda: calls.releases() == {"forward"}, "requests forward")
    page.keyboard.up("f")
    wait_until(lambda: has_ended(calls), "the end of them")


def test_the_page_shows_why_safety_refuses(page: Page, calls: CallServers) -> None:
    take_control(page)
    calls.peer.release_refusal = "The vehicle still moves."
    page.keyboard.down("b")
    wait_for_text(page, "#release-forbidden", "The vehicle still moves.")
    page.keyboard.up("b")
    page.wait_for_selector("#release-forbidden:empty", state="attached")


def test_a_forbidden_direction_is_released_and_disabled(page: Page, calls: CallServers) -> None:
    take_control(page)
    page.keyboard.down("b")
    wait_until(lambda: calls.releases() == {"backward"}, "requests backward")
    calls.peer.release = msgspec.structs.replace(FREE, forbidden=("backward",), left=0.02)
    wait_until(lambda: has_ended(calls), "the end of them")
    wait_for_text(page, "#release-forbidden", "Backward is forbidden until a reset")
    assert page.is_disabled("#release-backward")
    assert page.is_enabled("#release-forward")
    page.click("#language")
    wait_for_text(page, "#release-forbidden", "复位前禁止后退")
    page.click("#language")
    page.keyboard.up("b")
    calls.peer.requests.clear()
    page.keyboard.press("b")
    wait_for_text(page, "#toasts", "Backward is forbidden")
    assert calls.releases() == set()


def test_a_reset_answers_what_is_on_the_screen(page: Page, calls: CallServers) -> None:
    take_control(page)
    calls.boot += 1
    calls.is_effective = False
    calls.peer.causes = (NEWER,)
    wait_for_text(page, "#causes", "0.1 s")
    page.click("#reset")
    wait_for_text(page, "#toasts", "RESET NOT CONFIRMED")
    assert calls.resets[0].causes == (NEWER.id,)


def test_an_emergency_stop_goes_out_without_the_socket(page: Page, calls: CallServers) -> None:
    page.evaluate("() => { WebSocket.prototype.send = () => {}; }")
    calls.peer.estops.clear()
    page.click("#estop")
    wait_until(lambda: calls.peer.estops, "the emergency stop")
    calls.peer.latched = ("contact", "estop")
