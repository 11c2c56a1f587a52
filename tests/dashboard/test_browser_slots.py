"""Camera, embedded page and recordings in a real browser."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import BROWSER_MARKS, take_control, wait_for_text
from verification.harness.dashboard import dashboard
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS

IMAGE = (
    b'<svg xmlns="http://www.w3.org/2000/svg" width="64" height="36">'
    b'<rect width="64" height="36"/></svg>'
)


class Camera(BaseHTTPRequestHandler):
    """A camera and a map of robot 001."""

    def do_GET(self) -> None:
        """Serve an image, or a page."""
        found = {"/001/stream": ("image/svg+xml", IMAGE), "/map": ("text/html", b"<p>a map</p>")}
        kind, content = found.get(self.path, ("text/plain", b""))
        self.send_response(200 if content else 404)
        self.send_header("content-type", kind)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


@pytest.fixture(scope="module")
def camera() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Camera) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture
def page(
    browser: Browser, endpoint: str, peer: Peer, camera: str, tmp_path: Path
) -> Iterator[Page]:
    (tmp_path / "001-20260315-081530.mcap").write_bytes(bytes(10))
    sets = ("dashboard.round_trip=1.0", f"dashboard.recordings={tmp_path}")
    slots = (f"dashboard.camera={camera}/{{robot}}/stream", f"dashboard.embed={camera}/map")
    with dashboard(endpoint, tmp_path, *sets, *slots) as server:
        page = browser.new_page(locale="en-GB", viewport={"width": 1440, "height": 900})
        page.goto(server.url)
        yield page
        page.close()


def test_camera_map_and_recordings(page: Page, camera: str, tmp_path: Path) -> None:
    width = "document.querySelector('#camera img').naturalWidth"
    wait_until(lambda: page.evaluate(width) == 64, "the camera's image")
    frame = page.frame_locator("#embed iframe")
    assert frame.locator("p").inner_text() == "a map"
    take_control(page)
    events = "getComputedStyle(document.querySelector('#embed iframe')).pointerEvents"
    assert page.evaluate(events) == "none"  # a click would take the keyboard
    page.click("#recordings summary")
    wait_for_text(page, "#recordings", "001-20260315-081530.mcap")
    wait_for_text(page, "#recordings", "t2 report 001-20260315-081530.mcap")
    page.screenshot(path=tmp_path / "slots.png", full_page=True)
    page.evaluate(f"document.querySelector('#camera img').src = '{camera}/none'")
    wait_for_text(page, "#camera", "The camera does not answer.")
