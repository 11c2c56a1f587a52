"""The log ends in the logbook, and nowhere else."""

import pytest

from common.log import Logger
from common.settings import Log
from services.teleop.event_log import KEPT, Logbook
from services.teleop.view import Line


def test_lines_are_kept_the_newest_last() -> None:
    logbook = Logbook()
    for number in range(KEPT + 5):
        logbook.add("safety", "info", str(number), t_ns=number)
    assert logbook.last(2) == (
        Line(KEPT + 3, "safety", "info", str(KEPT + 3)),
        Line(KEPT + 4, "safety", "info", str(KEPT + 4)),
    )
    assert len(logbook.last(1000)) == KEPT


def test_log_lines_come_here_and_not_to_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    logbook = Logbook()
    logbook.take_log(Log(level="info"))
    log = Logger()
    log.debug("unseen")
    log.info("started")
    log.warning("waiting for a router", endpoints=["tcp/127.0.0.1:1"])
    log.error("broken")
    assert [(line.level, line.text) for line in logbook.last(9)] == [
        ("info", "started"),
        ("warning", "waiting for a router"),
        ("error", "broken"),
    ]
    assert logbook.last(1)[0].t_ns > 0
    assert capfd.readouterr() == ("", "")


def test_a_line_that_repeats_is_kept_once_with_its_last_time() -> None:
    logbook = Logbook()
    for t_ns, text in ((1, "stop"), (2, "refused"), (3, "refused"), (4, "stop")):
        logbook.add("safety", "info", text, t_ns)
    assert [(line.t_ns, line.text) for line in logbook.last(9)] == [
        (1, "stop"),
        (3, "refused"),
        (4, "stop"),
    ]
