"""E-STOP of the page in a real browser: in an old one, without a network, login or script."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route

from t2.messages import Cause, Phrase
from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import BROWSER_MARKS, take_control, text, wait_for_text
from verification.harness.dashboard import Server, dashboard
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS


@pytest.fixture
def page(browser: Browser, peer: Peer) -> Iterator[Page]:
    """An empty page; after the test nothing is latched and nothing is repeated."""
    peer.latched = ()
    peer.estops.clear()
    page = browser.new_page(viewport={"width": 1280, "height": 800}, locale="en-GB")
    yield page
    page.close()
    peer.latched = ("estop",)
    peer.wait_for_silence()
    peer.latched = ()


@pytest.fixture
def lonely(endpoint: str, tmp_path: Path) -> Iterator[Server]:
    """A dashboard that the test may kill."""
    with dashboard(endpoint, tmp_path) as it:
        yield it


DENIED = "{ configurable: true, get() { throw new Error('denied'); } }"
# Each takes something away that a browser may lack, or that somebody may have blocked.
OLD = {
    "abort signal": "delete AbortSignal.timeout; delete AbortSignal.any;",
    "storage": f"for (const name of ['localStorage', 'sessionStorage']) "
    f"Object.defineProperty(window, name, {DENIED});",
    "full storage": "Storage.prototype.setItem = () => { throw new Error('full'); };",
    "abort controller": "delete window.AbortController; delete window.AbortSignal;",
    "fetch": "delete window.fetch;",
    "fetch that throws": "window.fetch = () => { throw new TypeError('old'); };",
    "fetch that fails": "window.fetch = () => Promise.reject(new Error('blocked'));",
    "promises": "delete window.fetch; delete window.Promise;",
    "sockets": "delete window.WebSocket;",
    "clock": "Object.defineProperty(window, 'performance', { value: undefined });",
    "pointers": "delete window.PointerEvent; delete Element.prototype.closest;",
    "strings": "delete String.prototype.normalize; delete String.prototype.replaceAll;",
    "objects": "delete Object.hasOwn; delete Array.prototype.at; delete window.structuredClone;",
    "dialogs": "delete HTMLDialogElement.prototype.show; delete navigator.getGamepads;",
    "json of texts": "JSON.parse = () => { throw new Error('broken'); };",
}


@pytest.mark.parametrize("missing", OLD)
def test_an_old_browser_stops(page: Page, server: Server, peer: Peer, missing: str) -> None:
    page.add_init_script(OLD[missing])
    page.goto(server.url)
    page.click("#estop")
    wait_until(lambda: peer.estops, "the emergency stop")


@pytest.mark.parametrize("script", ["dashboard.js", "charts.js"])
def test_a_page_whose_scripts_do_not_run_stops_and_says_so(
    page: Page, server: Server, peer: Peer, script: str
) -> None:
    page.route(f"**/{script}", lambda route: route.abort())
    page.goto(server.url)
    wait_for_text(page, "#unsent", "only E-STOP works here")
    page.keyboard.press("e")
    wait_until(lambda: peer.estops, "the emergency stop")
    wait_for_text(page, "#unsent", "was sent to the dashboard")
    peer.latched = ("estop",)
    page.unroute(f"**/{script}")
    page.reload()
    wait_for_text(page, "#delay-value", " s")
    page.wait_for_function("() => !document.querySelector('#unsent').textContent")


def test_a_stop_without_a_network_is_sent_once_it_is_back(
    page: Page, lonely: Server, peer: Peer
) -> None:
    page.goto(lonely.url)
    wait_for_text(page, "#delay-value", " s")
    lonely.kill()
    page.click("#estop")
    wait_for_text(page, "#unsent", "NOT SENT YET")
    lonely.start()
    wait_until(lambda: peer.estops, "the emergency stop")
    peer.latched = ("estop",)
    page.wait_for_function("() => !localStorage.getItem('t2.estop.001')")  # it is confirmed
    assert text(page, "#unsent") == ""
    page.reload()
    wait_for_text(page, "#delay-value", " s")
    assert text(page, "#unsent") == ""


# The clocks of the page, ahead by a time that survives a reload.
AHEAD = """(() => {
  const ahead = () => Number(sessionStorage.getItem('ahead') || 0);
  const [mono, wall] = [performance.now.bind(performance), Date.prototype.getTime];
  performance.now = () => mono() + ahead();
  Date.prototype.getTime = function () { return wall.call(this) + ahead(); };
})()"""


def test_a_stop_that_is_too_old_is_not_sent_and_the_page_says_so_until_somebody_reads_it(
    page: Page, lonely: Server, peer: Peer
) -> None:
    page.add_init_script(AHEAD)
    page.goto(lonely.url)
    wait_for_text(page, "#delay-value", " s")
    lonely.kill()
    page.click("#estop")
    wait_for_text(page, "#unsent", "NOT SENT YET")
    page.evaluate("sessionStorage.setItem('ahead', 31000)")
    wait_for_text(page, "#unsent", "FOR ROBOT 001 WAS NOT SENT: press again")
    lonely.start()
    for _ in range(2):
        wait_for_text(page, "#delay-value", " s")
        wait_for_text(page, "#unsent", "WAS NOT SENT")
        page.reload()
    assert peer.estops == []
    page.click("#unsent button")
    page.wait_for_function("() => !document.querySelector('#unsent').textContent")
    page.reload()
    wait_for_text(page, "#delay-value", " s")
    assert text(page, "#unsent") == ""
    page.click("#estop")
    wait_until(lambda: peer.estops, "another emergency stop")


def test_a_stop_is_sent_from_the_page_of_another_robot(
    page: Page, lonely: Server, peer: Peer
) -> None:
    page.goto(lonely.url)
    wait_for_text(page, "#delay-value", " s")
    lonely.kill()
    page.click("#estop")
    wait_for_text(page, "#unsent", "NOT SENT YET")
    lonely.start()
    page.goto(f"{lonely.url}?robot=002")
    wait_for_text(page, "#robot-changed", "NOW ROBOT 002")
    wait_until(lambda: peer.estops, "the emergency stop of the first robot")
    wait_for_text(page, "#unsent", "robot 001 was sent")


def test_a_stop_after_the_login_has_expired_says_so(
    page: Page, endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    file = tmp_path / "token"
    file.write_text("open sesame", encoding="utf-8")
    with dashboard(endpoint, tmp_path, f"dashboard.token_file={file}") as server:
        page.goto(f"{server.url}?robot=001&token=open+sesame")
        wait_for_text(page, "#delay-value", " s")
        page.context.clear_cookies()
        page.click("#estop")  # its WebSocket still works
        wait_until(lambda: peer.estops, "the emergency stop")
        peer.latched = ("estop",)
        page.wait_for_function("() => !window.T2Estop.isOpen()")
        peer.latched = ()
        server.kill()
        page.click("#estop")
        server.start()
        wait_for_text(page, "#unsent", "your login has expired")
        page.click("#unsent button")
        page.fill("[name=token]", "open sesame")
        peer.estops.clear()
        page.keyboard.press("Enter")
        page.wait_for_url(f"{server.url}?robot=001")
        wait_until(lambda: peer.estops, "the emergency stop, sent after the login")


def test_a_page_keeps_its_robot_and_says_when_it_shows_another_one(
    page: Page, server: Server
) -> None:
    page.goto(server.url)
    wait_for_text(page, "#delay-value", " s")
    assert page.url == f"{server.url}?robot=001"
    assert not page.is_visible("#robot-changed")
    page.goto(f"{server.url}?robot=002")
    wait_for_text(page, "#robot-changed", "NOW ROBOT 002. Before, this window showed robot 001.")
    page.click("#robot-changed")
    assert not page.is_visible("#robot-changed")


def fulfil(body: str, route: Route) -> None:
    route.fulfill(body=body, content_type="text/html")


LINK = '<a id="link" href="{}">robot</a>'


def test_a_link_of_another_site_opens_the_robot(
    page: Page, endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    file = tmp_path / "token"
    file.write_text("open sesame", encoding="utf-8")
    with dashboard(endpoint, tmp_path, f"dashboard.token_file={file}") as server:
        for query in ("?robot=001&token=open+sesame", "?robot=001"):  # then with its cookie
            body = LINK.format(server.url + query)
            page.route("http://other.example/", partial(fulfil, body))
            page.goto("http://other.example/")
            page.click("#link")
            wait_for_text(page, "#delay-value", " s")
            assert page.url == f"{server.url}?robot=001"


WAKE = """() => {
  window.locks = [];
  const lock = () => {
    const release = () => { it.released = true; return Promise.resolve(); };
    const it = { released: false, release };
    window.locks.push(it);
    return it;
  };
  const value = { request: (kind) => Promise.resolve(lock(kind)) };
  Object.defineProperty(navigator, 'wakeLock', { configurable: true, value });
}"""
HELD = "() => window.locks.filter((it) => !it.released).length === {}"


def test_the_screen_stays_on_while_the_page_drives(page: Page, server: Server) -> None:
    page.add_init_script(f"({WAKE})()")
    page.goto(server.url)
    take_control(page)
    page.wait_for_function(HELD.format(1))
    assert not page.is_visible("#awake")
    page.evaluate("() => { window.locks[0].released = true; }")  # the page was hidden
    page.wait_for_function(HELD.format(1))
    page.click("#leave")
    page.wait_for_function(HELD.format(0))
    page.evaluate("Object.defineProperty(navigator, 'wakeLock', { value: undefined })")
    take_control(page)
    wait_for_text(page, "#awake", "cannot keep the screen on")
    page.wait_for_selector("#awake", state="visible")


def take_control_as(page: Page, server: Server, name: str) -> None:
    page.goto(server.url)
    take_control(page)
    page.fill("#name", name)
    page.keyboard.press("Enter")  # the lock has the name, too


def test_one_press_is_one_event_and_the_bar_names_its_operator(
    page: Page, server: Server, peer: Peer
) -> None:
    take_control_as(page, server, "Anna")
    page.click("#estop")
    wait_until(lambda: peer.estops, "the emergency stop")
    cause = Cause(name="estop", action="brake", age=0.0, text="", phrases=(Phrase("estop"),))
    peer.latched, peer.causes = ("estop",), (cause,)
    wait_for_text(page, "#detail", "Emergency stop by Anna.")
    peer.wait_for_silence()  # the other way has arrived
    mine = page.locator("#events li", has_text="Anna").all_inner_texts()
    assert len(mine) == 1, mine
    peer.causes = ()


def test_another_viewer_sees_the_name_and_no_is_preselected(
    page: Page, server: Server, browser: Browser
) -> None:
    take_control_as(page, server, "Anna")
    other = browser.new_page(locale="en-GB")
    other.goto(server.url)
    wait_for_text(other, "#driver", "Anna")
    other.click("#take")
    wait_for_text(other, "#question-text", "Anna")
    assert other.evaluate("document.activeElement.id") == "question-no"
    other.keyboard.press("Enter")
    wait_until(lambda: not other.is_visible("#question"), "the answer no")
    other.wait_for_timeout(500)  # some snapshots
    wait_for_text(other, "#driver", "Anna")
    assert not other.locator(".is-driver").count()
    other.close()
