"""The event log: newest lines, repeated lines, captured log lines."""

import pytest

from common.log import Logger
from common.settings import Log
from common.verdict import MAX_TEXT
from services.teleop.event_log import ANSWER_NS, CAPACITY, EventLog
from services.teleop.view import Line


def test_lines_are_kept_the_newest_last() -> None:
    event_log = EventLog()
    for number in range(CAPACITY + 5):
        event_log.add("safety", "info", str(number), t_ns=number)
    assert event_log.last(2) == (
        Line(CAPACITY + 3, "safety", "info", str(CAPACITY + 3)),
        Line(CAPACITY + 4, "safety", "info", str(CAPACITY + 4)),
    )
    assert len(event_log.last(1000)) == CAPACITY


def test_log_lines_go_to_the_event_log_and_not_to_the_terminal(
    capfd: pytest.CaptureFixture[str],
) -> None:
    event_log = EventLog()
    event_log.capture_logs(Log(level="info"))
    log = Logger()
    log.debug("unseen")
    log.info("started")
    log.warning("waiting for a router", endpoints=["tcp/127.0.0.1:1"])
    log.error("broken")
    assert [(line.level, line.text) for line in event_log.last(9)] == [
        ("info", "started"),
        ("warning", "waiting for a router"),
        ("error", "broken"),
    ]
    assert event_log.last(1)[0].t_ns > 0
    assert capfd.readouterr() == ("", "")


def test_a_repeated_line_is_kept_once_with_its_last_time() -> None:
    event_log = EventLog()
    for t_ns, text in ((1, "stop"), (2, "refused"), (3, "refused"), (4, "stop")):
        event_log.add("safety", "info", text, t_ns)
    assert [(line.t_ns, line.text) for line in event_log.last(9)] == [
        (1, "stop"),
        (3, "refused"),
        (4, "stop"),
    ]


def test_an_answer_that_also_comes_as_an_event_is_one_line() -> None:
    event_log = EventLog()
    for t_ns, text in (
        (1, "reset refused: contact"),
        (2, "contact"),
        (3, "reset refused: contact"),
    ):
        event_log.add("safety", "warning", text, t_ns)
        event_log.add("safety", "warning", "contact", t_ns)
    (line,) = event_log.last(9)
    assert (line.t_ns, line.text) == (3, "reset refused: contact")
    event_log.add("safety", "warning", "contact", 2 * ANSWER_NS)  # of another operator
    assert [line.text for line in event_log.last(9)] == ["reset refused: contact", "contact"]


def test_control_characters_of_an_event_are_escaped() -> None:
    event_log = EventLog()
    event_log.add("odom\x1b", "info", "\x1b]0;title\x07\x1b[2J\u202e急停\n" * 500, t_ns=1)
    (line,) = event_log.last(1)
    assert line.service == "odom\\u001b"
    assert line.text.startswith("\\u001b]0;title\\u0007\\u001b[2J\\u202e急停\\n")
    assert len(line.text) == MAX_TEXT
