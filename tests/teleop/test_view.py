"""The event log: newest lines, repeated lines, captured log lines."""

import pytest

from common.log import Logger
from common.settings import Log
from services.teleop.view import EventLog


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
    assert [(line.level, line.text) for line in event_log.lines()] == [
        ("info", "started"),
        ("warning", "waiting for a router"),
        ("error", "broken"),
    ]
    assert event_log.lines()[-1].t_ns > 0
    assert capfd.readouterr() == ("", "")


def test_a_line_is_printable_and_has_a_greatest_length() -> None:
    event_log = EventLog()
    event_log.add("\x1b[2J", "info", "\x1b" * 4000)
    (line,) = event_log.lines()
    assert (line.service, len(line.text)) == ("\\u001b[2J", 1000)
    assert line.text.isprintable()


def test_lines_are_in_the_order_of_their_times() -> None:
    event_log = EventLog()
    for t_ns in (3, 1, 2):
        event_log.add("safety", "info", f"event {t_ns}", t_ns)
    assert [line.t_ns for line in event_log.lines()] == [1, 2, 3]


def test_a_repeated_line_is_kept_once_with_its_last_time() -> None:
    event_log = EventLog()
    for t_ns, text in ((1, "stop"), (2, "refused"), (3, "refused"), (4, "stop")):
        event_log.add("safety", "info", text, t_ns)
    assert [(line.t_ns, line.text) for line in event_log.lines()] == [
        (1, "stop"),
        (3, "refused"),
        (4, "stop"),
    ]
