"""A driver who is overruled and a viewer without permission, in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from common.loop import Loop
from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import (
    BROWSER_MARKS,
    drive_until_moving,
    open_page,
    take_control,
    text,
    wait_for_standstill,
    wait_for_text,
)
from tests.drive_source import ConstantSource
from verification.harness.bus import at, bus_on, joined, running
from verification.harness.certificates import Site
from verification.harness.dashboard import Server, dashboard
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

pytestmark = BROWSER_MARKS


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[RunningStack]:
    with running_stack(tmp_path) as it:
        yield it


@pytest.fixture
def other(stack: RunningStack) -> Iterator[ConstantSource]:
    """A silent source of the highest priority."""
    with running(Loop()) as loop:
        source = ConstantSource(loop)
        source.linear = None
        with bus_on(stack.endpoint, loop, source.declare):
            yield source


def test_a_driver_who_is_overruled_sees_it_and_must_let_go(
    browser: Browser, stack: RunningStack, other: ConstantSource, tmp_path: Path
) -> None:
    with dashboard(stack.endpoint, tmp_path, "dashboard.round_trip=1.0") as server:
        page = browser.new_page(locale="en-GB")
        open_page(page, server)
        take_control(page)
        drive_until_moving(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
        wait_for_text(page, "#driver", "You drive")
        other.linear = 0.0
        wait_for_text(page, "#driver", "Overruled by teleop")
        wait_for_text(page, "#hold", "Another source drives")
        wait_for_text(page, "#sentence", "Overruled by teleop. teleop is in control.")
        assert page.get_attribute("#state", "data-tone") == "slow"  # not as requested
        page.click("#language")
        wait_for_text(page, "#sentence", "控制权已被其他来源取得： teleop。teleop 取得控制权。")
        page.click("#language")
        other.linear = -0.2
        wait_until(lambda: stack.speed() < -0.1, "the other operator backs up")
        other.linear = None
        wait_for_text(page, "#driver", "You drive")
        wait_for_standstill(stack)
        page.wait_for_timeout(1500)  # the key is still down
        assert abs(stack.speed()) < 0.005
        assert "release, then hold again" in text(page, "#hold")
        page.keyboard.up("w")
        drive_until_moving(stack, lambda: page.keyboard.down("w"), lambda: page.keyboard.up("w"))
        page.keyboard.up("w")
        page.close()


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


TLS = ("ca", "certificate", "private_key")


def test_a_viewer_is_offered_no_stick(browser: Browser, view_only: Server) -> None:
    page = browser.new_page(locale="en-GB")
    page.goto(view_only.url)
    wait_for_text(page, "#driver", "View only")
    wait_for_text(page, "#view-only", "View only: this certificate may not drive")
    assert page.is_visible("#view-only")
    for control in ("#take", "#stick", "#gears", "#reset"):
        assert not page.is_visible(control), control
    page.evaluate("document.querySelector('#take').click()")
    page.keyboard.down("w")
    page.wait_for_timeout(500)
    assert "You drive" not in text(page, "#driver")
    assert page.title().endswith("001 · T2")
    page.close()
