"""The floor plan: its settings and file, and where a real browser draws it."""

import struct
import zlib
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from common.config import flatten
from common.errors import ConfigError
from services.dashboard import floor_plan
from services.dashboard.config import Dashboard
from t2 import codec
from t2.messages import Setting, Settings
from tests import factories
from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import BROWSER_MARKS, wait_for_text
from tests.dashboard.test_browser_patrol import ODOM
from verification.harness.dashboard import dashboard

WIDTH, HEIGHT = 40, 20  # pixels, 10 for a metre
RED, GREEN = b"\xff\x00\x00", b"\x00\xff\x00"
FIRST, SECOND = (0, HEIGHT, 0, 0), (WIDTH, HEIGHT, 4, 0)
# The vehicle, at (1.234, -0.4) of ``odom``, is at the centre; 40 pixels are a metre.
IS_COLOR = """([x, y, expected]) => {
  const it = document.querySelector('#trail');
  const at = [it.clientWidth / 2 + (x - 1.234) * 40, it.clientHeight / 2 - (y + 0.4) * 40];
  const [red, green] = it.getContext('2d').getImageData(...at, 1, 1).data;
  return expected === (red > 2 * green ? 'red' : green > 2 * red ? 'green' : 'none');
}"""


def png() -> bytes:
    """Return an image whose left half is red, and whose right half is green."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        crc = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", crc)

    row = b"\x00" + RED * (WIDTH // 2) + GREEN * (WIDTH // 2)
    head = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(row * HEIGHT))
        + chunk(b"IEND", b"")
    )  # fmt: skip


@pytest.fixture
def image(tmp_path: Path) -> Path:
    file = tmp_path / "plan.png"
    file.write_bytes(png())
    return file


def settings(file: Path) -> Dashboard:
    return Dashboard(floor_plan=str(file), floor_plan_first=FIRST, floor_plan_second=SECOND)


def test_a_plan(image: Path) -> None:
    assert floor_plan.read(Dashboard()) is None
    plan = floor_plan.read(
        Dashboard(floor_plan=str(image), floor_plan_first=FIRST, floor_plan_second=SECOND)
    )
    assert plan == floor_plan.FloorPlan(png(), "image/png")


@pytest.mark.parametrize(
    ("first", "second", "reason"),
    [
        ((), (), "needs floor_plan_first and floor_plan_second"),
        (FIRST, (), "needs floor_plan_first and floor_plan_second"),
        (FIRST, (1, 2, 3), "each with four numbers"),
        (FIRST, (0, HEIGHT, 4, 0), "at least 20 pixels and 0.5 m apart"),
        (FIRST, (WIDTH, HEIGHT, 0, 0.4), "at least 20 pixels and 0.5 m apart"),
    ],
)
def test_points_that_are_no_scale(
    first: tuple[float, ...], second: tuple[float, ...], reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        Dashboard(floor_plan="plan.png", floor_plan_first=first, floor_plan_second=second)
    with pytest.raises(ValueError, match="need floor_plan, the image"):
        Dashboard(floor_plan_second=SECOND)


def test_its_settings_are_published_like_all_others() -> None:
    plan = settings(Path("plan.png"))
    made = {name: Setting(value=value, origin="") for name, value in flatten(plan)}
    assert made["floor_plan_first"].value == FIRST
    assert codec.decode(codec.encode(Settings(settings=made)), Settings).settings == made


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "cannot be read: No such file"),
        (b"", "is no PNG, JPEG or WebP"),
        (b"<svg/>", "is no PNG, JPEG or WebP"),
        (png() + bytes(10_000_000), "has 10.0 MB, at most 10 MB are allowed"),
    ],
)
def test_files_that_are_no_plan(content: bytes | None, reason: str, tmp_path: Path) -> None:
    file = tmp_path / "plan"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ConfigError, match=reason):
        floor_plan.read(
            Dashboard(floor_plan=str(file), floor_plan_first=FIRST, floor_plan_second=SECOND)
        )


@pytest.mark.timed
@BROWSER_MARKS[1]
def test_the_page_draws_it_where_it_is(
    browser: Browser, endpoint: str, peer: Peer, image: Path, tmp_path: Path
) -> None:
    sets = (
        f"dashboard.floor_plan={image}",
        f"dashboard.floor_plan_first={list(FIRST)}",
        f"dashboard.floor_plan_second={list(SECOND)}",
    )
    with dashboard(endpoint, tmp_path, *sets) as server:
        peer.safe, peer.latched = True, ()
        page = browser.new_page(locale="en-GB")
        page.goto(server.url)
        wait_for_text(page, "#delay-value", " s")
        assert page.evaluate(IS_COLOR, [0.3, -2.3, "none"])  # the vehicle is not placed
        peer.map_pose = factories.map_pose(odom=ODOM)
        page.wait_for_function(IS_COLOR, arg=[0.3, -2.3, "green"], timeout=20_000)
        assert page.evaluate(IS_COLOR, [0.3, -0.3, "red"])  # (1.3, 1.3) of the map
        assert page.evaluate(IS_COLOR, [0.9, 0.7, "red"])  # (0.3, 1.9)
        assert page.evaluate(IS_COLOR, [1.1, 0.7, "none"])  # (0.3, 2.1), above the image
        peer.map_pose = None
        page.close()
