"""The page of the shift log in a real browser, at a simulated recorder."""

import json
import urllib.error
import urllib.request
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from common.bus.bus import Bus, Caller
from common.freshness import NS_PER_S
from common.loop import Loop
from t2 import keys
from t2.messages import LogKind, LogReply, LogRequest, LogRow, Phrase
from tests.dashboard.bus_fixture import Peer
from tests.dashboard.page import BROWSER_MARKS, PHONE, wait_for_text
from verification.harness.bus import bus_on, running
from verification.harness.dashboard import Server

pytestmark = BROWSER_MARKS

NOON = 1_700_049_600  # 2023-11-15 12:00 UTC
HOSTILE = "<img src=x onerror=alert(1)>" + "n" * 200


def row(kind: LogKind, at_s: int, *phrases: Phrase, end_s: int = 0, recording: str = "") -> LogRow:
    return LogRow(
        kind=kind, robot="001", t_ns=at_s * NS_PER_S, end_ns=end_s * NS_PER_S, level="error",
        text="", phrases=phrases, recording=recording,
    )  # fmt: skip


ROWS = (
    row("gap", NOON - 7200, Phrase("log.gap"), end_s=NOON - 3600),
    row("stop", NOON - 9000, Phrase("estop.by", {"who": HOSTILE}),
        Phrase("log.reset_by", {"who": "Bob"}), end_s=NOON - 8990, recording="001-latch.mcap"),
    row("round", NOON - 50_000, Phrase("log.round", {"route": "yard"}), end_s=NOON - 40_000),
)  # fmt: skip
OLDER = (row("gap", 0, Phrase("log.gap"), end_s=NOON - 86_400),)


class LogServer:
    """A recorder with two pages of rows, or one that refuses."""

    def __init__(self) -> None:
        self.requests: list[LogRequest] = []
        self.refuses = False

    def declare(self, bus: Bus) -> None:
        bus.serve(keys.LOG, self.answer)

    def answer(self, request: LogRequest, caller: Caller[LogReply]) -> None:
        self.requests.append(request)
        if self.refuses:
            caller.refuse(Phrase("log.unreadable", {"file": "x", "reason": "y"}))
        elif request.before_ns is None:
            caller.reply(LogReply(rows=ROWS, more=True))
        else:
            caller.reply(LogReply(rows=OLDER))


@pytest.fixture
def recorder(endpoint: str, peer: Peer) -> Iterator[LogServer]:
    it = LogServer()
    with running(Loop()) as loop:

        def declare(bus: Bus) -> None:
            it.declare(bus)
            loop.post(lambda: loop.every(0.01, lambda _: bus.answer_queries()))

        with bus_on(endpoint, loop, declare):
            yield it


@pytest.fixture
def page(browser: Browser, recorder: LogServer, server: Server) -> Iterator[Page]:
    page = browser.new_page(viewport=PHONE, locale="en-GB", timezone_id="Asia/Shanghai")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("dialog", lambda dialog: problems.append(dialog.message))
    page.goto(f"{server.url}log")
    yield page
    page.close()
    assert problems == []


def lines(page: Page) -> list[str]:
    """Return the headings of days and the rows, as they are shown."""
    page.wait_for_selector("#log li")
    return [
        " | ".join(it.inner_text().split("\n")) for it in page.locator("#log :is(h2, li)").all()
    ]


def test_rows_are_listed_by_days_of_the_viewer_and_older_ones_on_demand(
    page: Page, recorder: LogServer
) -> None:
    shown = [each.replace(" |  | ", " | ").replace(",", "") for each in lines(page)]
    assert shown[:2] == [
        "Wednesday 15 November 2023",
        "18:00:00 – 19:00:00 | gap | NOT RECORDED: the recorder was off "
        "or received nothing from safety.",
    ]
    assert shown[2].startswith("17:30:00 – 17:30:10 | stop | Emergency stop by <img src=x")
    assert shown[2].endswith("Reset by Bob. | 001-latch.mcap")
    assert shown[3] == "06:06:40 – 08:53:20 | round | Round on yard."
    page.click("#log-older")
    page.wait_for_selector("#log li >> nth=3")
    assert lines(page)[-1].startswith("until 20:00:00 | gap")
    assert page.is_hidden("#log-older")
    assert recorder.requests[-1].before_ns == ROWS[-1].t_ns


def test_the_page_fits_a_phone_and_speaks_chinese(page: Page) -> None:
    lines(page)
    assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
    page.click("#language")
    assert "Bob 已复位。" in " ".join(lines(page))
    assert page.inner_text("h1") == "值班日志"
    page.set_viewport_size({"width": 1366, "height": 850})
    assert page.evaluate("document.documentElement.scrollWidth") == 1366


def test_a_refusal_is_shown_until_there_are_rows(page: Page, recorder: LogServer) -> None:
    lines(page)
    recorder.refuses = True
    page.reload()
    wait_for_text(page, "#log-problem", "cannot be read: y.")
    recorder.refuses = False
    assert len(lines(page)) > 3
    assert page.inner_text("#log-problem") == ""


def test_the_main_page_leads_to_it(page_of_peer: Page, recorder: LogServer) -> None:
    with page_of_peer.context.expect_page() as opened:
        page_of_peer.click("[data-t=shift_log]")
    assert "001-latch.mcap" in " ".join(lines(opened.value))
    opened.value.close()


def test_a_robot_that_is_unknown_is_named(server: Server) -> None:
    with urllib.request.urlopen(f"{server.url}log/rows?robot=none&before=x") as answer:
        assert "does not know the robot" in json.load(answer)["problem"]["en"]
    with urllib.request.urlopen(f"{server.url}log/rows?robot=002") as answer:
        problem = json.load(answer)["problem"]["en"]  # of its own session, and without a recorder
    assert "recorder" in problem or "not connected" in problem.lower()
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"{server.url}log?robot=%3Cb%3E")
