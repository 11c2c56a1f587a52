"""The driving layout on four screens: what a driver needs is visible, and nothing overlaps."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from sim.requests import Bumper
from tests.dashboard.page import (
    BROWSER_MARKS,
    open_page,
    reset_all,
    take_control,
    wait_for_text,
)
from verification.harness.dashboard import Server, dashboard
from verification.harness.stack import RunningStack

pytestmark = BROWSER_MARKS

SCREENS = ((1440, 900), (1024, 700), (844, 390), (360, 640))
NEEDED = ("#estop", "#verdict", "#sentence", "#speed", "#sonar-view", "#stick")
RELEASE = ("#release-forward", "#release-backward")  # at a pressed bumper
BOX = """where => {
  const it = document.querySelector(where).getBoundingClientRect();
  return [it.left, it.top, it.right, it.bottom];
}"""

CUT = """[...document.querySelectorAll('.chip:not(#driver)')]
  .filter((it) => it.scrollWidth > it.clientWidth).map((it) => it.textContent)"""


@pytest.fixture(scope="module")
def server(stack: RunningStack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("server")
    with dashboard(stack.endpoint, folder) as it:
        yield it


@pytest.fixture
def page(browser: Browser, server: Server, stack: RunningStack) -> Iterator[Page]:
    page = browser.new_page(locale="en-GB")
    open_page(page, server)
    take_control(page)
    stack.control.do(Bumper(pressed=False))  # a test that failed may have left it pressed
    reset_all(page)
    yield page
    page.close()


def problems(page: Page, width: int, height: int, needed: Sequence[str]) -> list[str]:
    """Return what is wrong on a screen of this size; ``needed`` must be visible."""
    page.set_viewport_size({"width": width, "height": height})
    page.evaluate("scrollTo(0, 0)")
    page.wait_for_timeout(100)
    boxes = {where: page.evaluate(BOX, where) for where in needed}
    found = [
        f"{where} is outside: {box}"
        for where, box in boxes.items()
        if box[0] < 0 or box[1] < 0 or box[2] > width or box[3] > height
    ]
    found += [
        f"{one} and {other} overlap"
        for one, other in combinations(needed, 2)
        if overlap(boxes[one], boxes[other])
    ]
    if page.evaluate("document.documentElement.scrollWidth") > width:
        found.append("it scrolls sideways")
    found += [f"{chip} is cut" for chip in page.evaluate(CUT)]
    page.evaluate("scrollTo(0, 400)")
    page.wait_for_timeout(100)
    for where in ("#estop", "#verdict"):
        if width <= 1100 and page.evaluate(BOX, where)[1] < 0:
            found.append(f"{where} scrolls away")
    if page.evaluate(BOX, "#estop") != boxes["#estop"]:
        found.append("the emergency stop moves")
    return found


def uncovered(page: Page) -> list[str]:
    """Return which notices cover the driving panel, and whether there are more than two."""
    page.evaluate("scrollTo(0, 0)")
    page.wait_for_timeout(100)
    boxes = page.evaluate(
        """() => [...document.querySelectorAll('#toasts div, .driving')].map((it) => {
          const box = it.getBoundingClientRect();
          return [box.left, box.top, box.right, box.bottom];
        })"""
    )
    panel, *notices = boxes
    found = [f"{each} covers the driving panel" for each in notices if overlap(each, panel)]
    return found if len(notices) == 2 else [*found, f"{len(notices)} notices"]


NOTICES = """() => import('/t2/notices.js').then((it) => {
  const text = 'The release was refused: the vehicle still moves. ';
  for (const end of 'abc') it.toast(text + end, 'error');
})"""


def overlap(one: list[float], other: list[float]) -> bool:
    left, top = max(one[0], other[0]), max(one[1], other[1])
    return left < min(one[2], other[2]) - 1 and top < min(one[3], other[3]) - 1


def on_all_screens(
    page: Page, pictures: Path, name: str, needed: Sequence[str] = NEEDED, *, notices: bool = False
) -> dict[str, list[str]]:
    found = {}
    for width, height in SCREENS:
        if notices:  # anew, as they disappear after a time
            page.evaluate(NOTICES)
        wrong = problems(page, width, height, needed) + (uncovered(page) if notices else [])
        page.evaluate("scrollTo(0, 0)")
        page.screenshot(path=pictures / f"{name}-{width}x{height}.png")
        if wrong:
            found[f"{name} {width}x{height}"] = wrong
    return found


@pytest.mark.campaign
@pytest.mark.parametrize("language", ["en", "zh"])
def test_a_driver_sees_everything(
    page: Page, stack: RunningStack, tmp_path: Path, language: str
) -> None:
    if language == "zh":
        page.click("#language")
    found = on_all_screens(page, tmp_path, f"free-{language}")
    stack.control.do(Bumper(pressed=True))
    page.wait_for_selector("#release.due")
    found |= on_all_screens(page, tmp_path, f"release-{language}", (*NEEDED, *RELEASE))
    page.keyboard.down("b")
    by_hand = "Push the vehicle off by hand" if language == "en" else "请用手推开车辆"
    wait_for_text(page, "#sentence", by_hand)
    page.keyboard.up("b")
    needed = (*NEEDED, *RELEASE)
    found |= on_all_screens(page, tmp_path, f"used-up-{language}", needed, notices=True)
    assert page.get_attribute("#reset", "title") == page.text_content("#release-forbidden")
    page.click("#estop")
    wait_for_text(page, "#detail", "Also to reset" if language == "en" else "还须复位")
    found |= on_all_screens(
        page, tmp_path, f"contact-{language}", (*NEEDED, "#reset"), notices=True
    )
    stack.control.do(Bumper(pressed=False))
    page.set_viewport_size({"width": 1440, "height": 900})
    reset_all(page)
    assert found == {}, f"{found}; see {tmp_path}"


def test_a_press_that_was_meant_for_the_gears_does_not_reset(
    page: Page, stack: RunningStack
) -> None:
    """On this screen Reset appears where the gears were."""
    page.set_viewport_size({"width": 1366, "height": 768})
    page.click("[data-gear='2']")
    gears = page.evaluate(BOX, "#gears")
    page.keyboard.press("e")
    page.wait_for_selector("#reset.due")
    page.wait_for_timeout(1000)  # the cause is gone
    reset = page.evaluate(BOX, "#reset")
    top, bottom = max(gears[1], reset[1]), min(gears[3], reset[3])
    assert top < bottom  # Reset is where the gears were
    point = (max(gears[0], reset[0]) + 20, (top + bottom) / 2)
    for _ in range(3):
        page.mouse.click(*point)
        wait_for_text(page, "#toasts", "The buttons have moved.")
        page.wait_for_timeout(500)
    assert page.locator("#reset.due").count() == 1
    page.wait_for_timeout(1600)
    page.mouse.click(*point)
    page.wait_for_selector("#reset.due", state="detached")
