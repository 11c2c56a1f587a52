"""Driving by the picture of a camera, in a real browser, with the real chain and simulator.

The oracle reads the trace of the simulated board: each RUN that moves needs a picture that the
browser could show, and whose heartbeat is young enough.
"""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from common import clock
from common.freshness import NS_PER_S
from common.loop import Loop
from tests.dashboard.page import (
    BROWSER_MARKS,
    drive_until_moving,
    open_page,
    take_control,
    text,
    wait_for_text,
)
from tests.dashboard.scripted_camera import ScriptedCamera
from verification.harness.bus import bus_on, running
from verification.harness.dashboard import Server, dashboard
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS

NOT_POSSIBLE = "driving is not possible"


@pytest.fixture(scope="module")
def server(stack: RunningStack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with dashboard(stack.endpoint, tmp_path_factory.mktemp("server")) as it:
        yield it


@pytest.fixture
def camera(stack: RunningStack) -> Iterator[ScriptedCamera]:
    with running(Loop()) as loop:
        camera = ScriptedCamera(loop)
        with bus_on(stack.endpoint, loop, camera.declare):
            yield camera


@pytest.fixture
def page(
    browser: Browser, server: Server, camera: ScriptedCamera, stack: RunningStack
) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1024, "height": 700}, locale="en-GB")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    open_page(page, server)
    wait_for_text(page, "#picture-age", "s old")
    take_control(page)
    yield page
    page.keyboard.up("d")
    wait_until(lambda: not is_turning(stack), "the vehicle stands")
    page.close()
    assert problems == []


def turn(page: Page, stack: RunningStack) -> None:
    """Turn on the spot: the vehicle stays in its room however long it takes."""

    def press() -> None:
        page.keyboard.up("d")
        page.keyboard.down("d")

    for _ in range(20):
        press()
        try:
            wait_until(lambda: is_turning(stack), "the vehicle turns", patience_s=2)
        except AssertionError:
            continue
        return
    raise AssertionError(f"never turned: {text(page, '#hold')}, {text(page, '#picture-age')}")


def is_turning(stack: RunningStack) -> bool:
    return abs(stack.control.truth().angular) > 0.1


def moving_runs(stack: RunningStack, since_ns: int) -> list[int]:
    """Return the times of the moving commands that the board received since then."""
    return [
        it.mono_ns
        for it in stack.trace().commands
        if it.kind == "run" and (it.linear or it.angular) and it.mono_ns > since_ns
    ]


def limit_ns(stack: RunningStack) -> int:
    """Return for how long after a heartbeat safety may let a request through that answers it.

    Its request may be as old as safety allows, and drives until its lease ends; one decision.
    """
    config = stack.config
    stall = 3 * config.host.stall
    times_s = 0.4 + stall + config.safety.sources["web"].lease + stall + 0.05
    return round(times_s * NS_PER_S)


def test_a_driver_sees_the_picture_and_its_age(page: Page, stack: RunningStack) -> None:
    before = int(page.get_attribute("#picture", "data-seq") or 0)
    turn(page, stack)
    assert int(page.get_attribute("#picture", "data-seq") or 0) > before
    assert "s old" in text(page, "#picture-age")  # young when it turned; a busy host is late


def freeze(camera: ScriptedCamera) -> None:
    camera.mode = "frozen"


def cut(camera: ScriptedCamera) -> None:
    camera.mode = "cut"


def delay(camera: ScriptedCamera) -> None:
    camera.delay_s = 1.5


def damage_all(camera: ScriptedCamera) -> None:
    camera.damage = lambda jpeg: jpeg[:2] + bytes(len(jpeg) - 4) + jpeg[-2:]


def truncate(camera: ScriptedCamera) -> None:
    camera.damage = lambda jpeg: jpeg[: len(jpeg) // 2]


@pytest.mark.parametrize("fault", [freeze, cut, delay, damage_all, truncate])
def test_nothing_drives_by_a_picture_that_is_not_of_now(
    page: Page, stack: RunningStack, camera: ScriptedCamera, fault: Callable[[ScriptedCamera], None]
) -> None:
    turn(page, stack)
    fault(camera)
    at_ns = clock.now_ns()
    wait_for_text(page, "#picture-age", NOT_POSSIBLE)
    wait_for_text(page, "#hold", NOT_POSSIBLE)
    wait_for_text(page, "#sentence", NOT_POSSIBLE)  # and not that nobody drives
    until_ns = at_ns + limit_ns(stack)
    while clock.now_ns() < until_ns + 2 * NS_PER_S:  # held, and pressed again and again
        time.sleep(0.5)
        page.keyboard.up("d")
        page.keyboard.down("d")
    assert not is_turning(stack)
    assert moving_runs(stack, until_ns) == []
    camera.mode, camera.delay_s, camera.damage = "normal", 0.0, lambda jpeg: jpeg
    page.keyboard.up("d")
    turn(page, stack)


def test_older_pictures_that_come_later_are_not_shown(
    page: Page, stack: RunningStack, camera: ScriptedCamera
) -> None:
    camera.mode = "reordered"
    page.evaluate("""() => {
      window.seqs = [];
      const it = document.querySelector('#picture');
      const note = () => window.seqs.push(Number(it.dataset.seq));
      new MutationObserver(note).observe(it, { attributes: true });
    }""")
    turn(page, stack)
    wait_until(lambda: page.evaluate("window.seqs.length") > 20, "20 pictures")
    seqs = page.evaluate("window.seqs")
    assert seqs == sorted(seqs)


def test_who_sees_the_vehicle_drives_without_the_picture(
    page: Page, stack: RunningStack, camera: ScriptedCamera
) -> None:
    page.fill("#name", "Anna")
    camera.mode = "cut"
    wait_for_text(page, "#picture-age", NOT_POSSIBLE)
    page.click("#sight")
    wait_for_text(page, "#sight", "IN SIGHT")
    wait_for_text(page, "#events", "Anna sees the vehicle and drives without the picture.")
    turn(page, stack)
    page.keyboard.up("d")
    page.click("#leave")
    take_control(page)  # another drive begins by the picture again
    wait_for_text(page, "#sight", "I see the vehicle")
    page.keyboard.down("d")
    wait_for_text(page, "#hold", NOT_POSSIBLE)
    page.click("#language")
    wait_for_text(page, "#hold", "不能驾驶")


def test_a_vehicle_without_a_camera_is_driven_as_before(
    browser: Browser, server: Server, stack: RunningStack, tmp_path: Path
) -> None:
    with dashboard(stack.endpoint, tmp_path) as other:
        page = browser.new_page(locale="en-GB")
        open_page(page, other)
        take_control(page)
        drive_until_moving(stack, lambda: page.keyboard.down("s"), lambda: page.keyboard.up("s"))
        page.keyboard.up("s")
        assert page.is_hidden("#camera")
        page.close()
