"""The event log: newest lines, repeated lines, captured log lines."""

from typing import Any

import pytest

from common import clock
from common.freshness import NS_PER_S
from common.log import Logger
from common.settings import Log
from services.teleop.event_log import LINES, EventLog
from t2.messages import Event


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
    event_log.add("\x1b[2J", "info", (), "\x1b" * 4000)
    (line,) = event_log.lines()
    assert (line.service, len(line.text)) == ("\\u001b[2J", 1000)
    assert line.text.isprintable()


def told(log: EventLog, text: str, **header: Any) -> None:
    log.add("safety", "info", (), text, Event(name="stop", level="info", text=text, **header))


def test_arrival_orders_lines_whatever_their_wall_clocks_are() -> None:
    now_s, ahead_s = 1_770_000_000, 8 * 3600
    log = EventLog()
    times = [*(now_s + ahead_s + n for n in range(80)), now_s + 100]
    for n, time_s in enumerate(times):
        told(log, f"event {n}", t_ns=time_s * 10**9, host=n % 2)
    assert [line.text for line in log.lines()] == [f"event {n}" for n in range(81 - LINES, 81)]


def test_the_history_of_one_host_is_ordered_by_its_monotonic_clock() -> None:
    log = EventLog()
    for host, mono_ns, t_ns in ((1, 30, 7), (1, 50, 1), (2, 10, 2), (1, 20, 9), (1, 10, 3)):
        told(log, f"{host} {mono_ns}", host=host, mono_ns=mono_ns, t_ns=t_ns)
    for host, mono_ns in ((1, 40), (1, 15), (0, 1)):
        told(log, f"{host} {mono_ns}", host=host, mono_ns=mono_ns)
    log.add("teleop", "info", (), "own")
    assert [line.text for line in log.lines()] == [
        "1 30", "1 50", "2 10", "1 10", "1 15", "1 20", "1 40", "0 1", "own",
    ]  # fmt: skip


def test_after_its_history_arrival_orders_the_events_of_a_host(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, before_ns = EventLog(), clock.now_ns()
    told(log, "long ago", host=1, mono_ns=2)
    monkeypatch.setattr(clock, "now_ns", lambda: before_ns + 3 * NS_PER_S)
    told(log, "new", host=1, mono_ns=1)  # another host with the same id
    assert [line.text for line in log.lines()] == ["long ago", "new"]


def test_a_repeated_line_is_kept_once_with_its_last_time() -> None:
    log = EventLog()
    for t_ns, text in ((1, "stop"), (2, "refused"), (3, "refused"), (4, "stop")):
        told(log, text, t_ns=t_ns)
    assert [(line.t_ns, line.text) for line in log.lines()] == [
        (1, "stop"),
        (3, "refused"),
        (4, "stop"),
    ]
