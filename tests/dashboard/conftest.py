"""A router, its simulated safety, a dashboard and a browser for a module, and call servers."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from common.loop import Loop
from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import CHROMIUM, wait_for_text
from tests.dashboard.servers import CallServers, serving
from verification.harness.bus import bus_on, router_process, running
from verification.harness.dashboard import Server, dashboard
from verification.harness.ports import free_port
from verification.harness.stack import RunningStack, running_stack


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture(scope="module")
def peer(endpoint: str) -> Iterator[Peer]:
    with running(Loop()) as loop:
        peer = Peer(loop)
        with bus_on(endpoint, loop, peer.declare):
            yield peer


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    """The real chain with a simulated vehicle."""
    with running_stack(tmp_path_factory.mktemp("stack")) as it:
        yield it


@pytest.fixture(scope="module")
def server(endpoint: str, peer: Peer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with dashboard(endpoint, tmp_path_factory.mktemp("server")) as it:
        yield it


@pytest.fixture
def calls(endpoint: str, peer: Peer) -> Iterator[CallServers]:
    with serving(endpoint, peer) as it:
        yield it


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def page_of_peer(browser: Browser, server: Server, peer: Peer) -> Iterator[Page]:
    """The page at the simulated safety, with a state of it."""
    peer.safe, peer.latched = True, ()
    page = browser.new_page(viewport={"width": 1280, "height": 800}, locale="en-GB")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(server.url)
    wait_for_text(page, "#delay-value", " s")
    yield page
    page.close()
    assert problems == []
