"""The page in a real browser at a simulated safety: release, roles, what is not there."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from playwright.sync_api import Browser, Page

from common.loop import Loop
from t2.messages import PlaneFrame
from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import BROWSER_MARKS, center_of, take_control, text, wait_for_text
from tests.dashboard.servers import FREE, NEWER, CallServers
from tests.factories import limit_source, map_pose
from verification.harness.bus import at, joined, running
from verification.harness.certificates import Site
from verification.harness.dashboard import Server, dashboard
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1280, "height": 800}, locale="en-GB")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    yield page
    page.close()
    assert problems == []


def test_the_pose_in_the_map(page: Page, server: Server, peer: Peer) -> None:
    page.add_init_script("""
        const draw = CanvasRenderingContext2D.prototype.ellipse;
        window.ellipses = [];
        CanvasRenderingContext2D.prototype.ellipse = function (...it) {
            window.ellipses.push(it);
            return draw.apply(this, it);
        };
    """)
    page.goto(server.url)
    peer.map_pose = map_pose("unplaced")
    wait_for_text(page, "#map", "The position is not known: place the vehicle")
    assert page.evaluate("window.ellipses.length") == 0
    peer.map_pose = map_pose(odom=PlaneFrame(x=0.0, y=0.0, heading=0.5))
    wait_for_text(page, "#map", "(standard deviations). In the map: x 4.00 m, y 2.00 m, 29°.")
    page.wait_for_function("() => window.ellipses.length > 0")
    axis, other, rotation = page.evaluate("window.ellipses.at(-1).slice(2, 5)")
    assert (axis / other, rotation) == pytest.approx((2.0, 0.5))
    page.click("#language")
    wait_for_text(page, "#map", "地图位姿：x 4.00 m")
    peer.map_pose = None  # localization has ended
    page.wait_for_function("() => document.querySelector('#map').textContent === ''")
    page.click("#language")


def at_a_contact(page: Page, server: Server) -> None:
    page.goto(server.url)
    wait_for_text(page, "#causes", "The bumper was hit.")
    take_control(page)


def has_ended(calls: CallServers) -> bool:
    return calls.peer.requests[-1].release == "none"


def test_the_operator_chooses_the_direction(page: Page, server: Server, calls: CallServers) -> None:
    at_a_contact(page, server)
    believed = "Backward is believed free: the last motion was forward 0.40 m"
    wait_for_text(page, "#release-free", believed)
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


def test_a_reset_answers_what_is_on_the_screen(
    page: Page, server: Server, calls: CallServers
) -> None:
    at_a_contact(page, server)
    calls.boot += 1
    calls.is_effective = False
    calls.peer.release = msgspec.structs.replace(FREE, left=0.0)
    calls.peer.causes = (NEWER,)
    wait_for_text(page, "#causes", "0.1 s")
    page.keyboard.press("r")
    wait_for_text(page, "#toasts", "RESET NOT CONFIRMED")
    assert calls.resets[0].causes == (NEWER.id,)


def test_an_emergency_stop_goes_out_without_the_socket(
    page: Page, server: Server, calls: CallServers
) -> None:
    at_a_contact(page, server)
    page.evaluate("() => { WebSocket.prototype.send = () => {}; }")
    calls.peer.estops.clear()
    page.click("#estop")
    wait_until(lambda: calls.peer.estops, "the emergency stop")
    calls.peer.latched = ("contact", "estop")


def test_a_page_in_the_background_does_not_keep_the_stop_alive(
    page: Page, endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    peer.keepalives = (limit_source("web", age=None, silent=True, silence="latch"),)
    with dashboard(endpoint, tmp_path, "dashboard.estop_keepalive=web") as server:
        page.goto(server.url)
        wait_until(lambda: peer.kept_alive, "messages")
        wait_for_text(page, "#keeper", "This page keeps the emergency stop alive")
        hidden = "Object.defineProperty(document, 'hidden', { get: () => true })"
        page.evaluate(hidden)
        page.wait_for_timeout(300)
        peer.kept_alive.clear()
        page.wait_for_timeout(700)
        assert peer.kept_alive == []
    peer.keepalives = ()


TLS = ("ca", "certificate", "private_key")


@pytest.fixture
def view_only(tmp_path: Path) -> Iterator[Server]:
    """A dashboard with a viewer's certificate, at a router with a simulated safety on board."""
    site = Site(tmp_path / "keys")
    viewer = site.member("viewer", "hall")
    robot = site.member("robot", "001", "--address", "127.0.0.1")
    tls = [f"bus.{name}={getattr(viewer, name)}" for name in TLS]
    with (
        site.router(robot) as (secured, onboard),
        running(Loop()) as loop,
        joined(at(onboard), "001", loop, Peer(loop).declare),
        dashboard(secured, tmp_path, *tls) as server,
    ):
        yield server


def test_a_viewer_is_offered_no_stick_and_no_stop(page: Page, view_only: Server) -> None:
    page.goto(view_only.url)
    wait_for_text(page, "#driver", "View only")
    wait_for_text(page, "#view-only", "this page can neither drive nor stop")
    assert page.locator("#estop.unable").count() == 1
    page.click("#estop")
    wait_for_text(page, "#toasts", "Use the vehicle's own switch")
    for control in ("#take", "#stick", "#gears", "#reset"):
        assert not page.is_visible(control), control
    page.evaluate("document.querySelector('#take').click()")
    page.keyboard.down("w")
    page.wait_for_timeout(500)
    assert "You drive" not in text(page, "#driver")


TONES = """
    window.tones = [];
    const start = OscillatorNode.prototype.start;
    OscillatorNode.prototype.start = function (...at) {
        window.tones.push(this.frequency.value);
        return start.apply(this, at);
    };
"""
LATCH, READY, LOST = [440, 330], [880], [330, 330, 330]


def test_a_stop_a_lost_connection_and_their_end_are_heard(
    page: Page, endpoint: str, tmp_path: Path, peer: Peer
) -> None:
    page.add_init_script(TONES)

    def heard(tones: list[int]) -> None:
        # A stall of the host may add the tones of a lost connection.
        page.wait_for_function("(it) => `${tones}`.includes(`${it}`)", arg=tones, timeout=20_000)
        page.evaluate("window.tones = []")

    with dashboard(endpoint, tmp_path) as server:
        page.goto(server.url)
        take_control(page)  # a press: the browser allows sound
        page.wait_for_function("() => navigator.userActivation.hasBeenActive")
        peer.latched = ("contact",)
        heard(LATCH)
        peer.latched = ()
        heard(READY)
        peer.latched = ("contact",)  # soon after the last one: the signal comes later
        heard(LATCH)
        page.uncheck("#sound")
        page.wait_for_timeout(2500)
        peer.latched = ()
        page.wait_for_selector("#reset:not(.due)")
        page.wait_for_timeout(500)
        page.check("#sound")
        assert page.evaluate("tones") == []
    heard(LOST)


def test_what_does_not_run_is_in_the_header(page: Page, server: Server) -> None:
    page.goto(server.url)
    wait_for_text(page, "#missing", "Not running: odometry, recorder")
