"""Rows of the shift log, from events."""

from collections.abc import Iterator
from itertools import count

import pytest

from common.freshness import NS_PER_S
from services.recorder.shift import NAME_MAX, Seen, Span, is_logged, rows
from t2.messages import Event, EventName, Field, Level, LogRow, Phrase
from t2.words import render

HOUR_S = 3600.0
_seq: Iterator[int] = count(1)


def ns(at_s: float) -> int:
    return round(at_s * NS_PER_S)


def seen(
    at_s: float,
    service: str,
    name: EventName,
    *phrases: Phrase,
    level: Level = "info",
    text: str = "",
    **about: Field,
) -> Seen:
    event = Event(
        seq=next(_seq), boot=1, name=name, level=level, text=text, phrases=phrases, about=about
    )
    return Seen(ns(at_s), service, event)


def latch(at_s: float, name: EventName = "contact") -> Seen:
    return seen(at_s, "safety", name, Phrase(name), level="error", cause=name)


def asked(at_s: float, name: EventName, by: str, service: str = "dashboard") -> Seen:
    return seen(at_s, service, name, Phrase(f"event.{name}", {"by": by}), by=by)


def reset(at_s: float) -> Seen:
    return seen(at_s, "safety", "reset", Phrase("reset.done"))


def log(*events: Seen) -> list[LogRow]:
    """Return the rows of these events, the oldest first."""
    return rows("001", events, [])[::-1]


def texts(found: list[LogRow]) -> list[str]:
    return [f"{row.kind}: {row.text}" for row in found]


def test_a_stop_and_its_reset_are_one_row_with_both_names() -> None:
    (row,) = log(asked(9.5, "estop", "Ann"), latch(10, "estop"), asked(99, "reset_request", "Bob"),
                 reset(100))  # fmt: skip
    assert (row.kind, row.by, row.reset_by) == ("stop", "Ann", "Bob")
    assert (row.t_ns, row.end_ns, row.level) == (ns(10), ns(100), "error")
    assert row.text == "Emergency stop by Ann. Reset by Bob."
    assert render(row.phrases, "zh") == "Ann 触发了急停。Bob 已复位。"


def test_the_events_of_one_stop_may_arrive_in_any_order() -> None:
    (row,) = log(latch(10, "estop"), reset(99), asked(10.5, "estop", "Ann", "teleop"),
                 asked(99.5, "reset_request", "Bob", "teleop"))  # fmt: skip
    assert (row.by, row.reset_by) == ("Ann", "Bob")


def test_a_name_counts_for_one_stop_only_and_not_for_a_distant_one() -> None:
    found = log(asked(1, "estop", "Ann"), latch(10, "estop"), reset(20))
    assert texts(found) == [
        "stop: Emergency stop by Ann. Safety did not report that.",
        "stop: Emergency stop. Reset; the name is not recorded.",
    ]


def test_causes_that_latch_together_are_one_stop_and_later_ones_another() -> None:
    found = log(latch(10), latch(11, "runaway"), latch(60, "flapping"), reset(100))
    assert texts(found) == [
        "stop: The bumper was hit. The vehicle did not move as commanded. "
        "Reset; the name is not recorded.",
        "stop: Inputs failed repeatedly. Reset; the name is not recorded.",
    ]


def test_a_partial_reset_ends_no_stop() -> None:
    partial = seen(20, "safety", "reset", Phrase("reset.partial"), Phrase("contact"))
    found = log(latch(10), asked(19, "reset_request", "Bob"), partial)
    assert texts(found) == [
        "stop: The bumper was hit. No reset is recorded.",
        "reset: Reset by Bob. Reset, but these need another reset: The bumper was hit.",
    ]
    assert found[0].end_ns == 0


def test_resets_without_a_stop_and_refused_ones_have_rows() -> None:
    refused = seen(20, "safety", "reset_refused", Phrase("reset.motion"), level="warning")
    found = log(
        reset(10), asked(19, "reset_request", "Bob"), refused, asked(50, "reset_request", "Cy")
    )
    assert texts(found) == [
        "reset: Reset; the name is not recorded.",
        "reset: Asked for by Bob. Reset refused. "
        "A command to drive is given: let go of the controls first.",
        "reset: Reset pressed by Cy. Safety did not report that.",
    ]


def test_take_overs_of_page_and_terminal() -> None:
    phrase = Phrase("event.take_over", {"by": "Ann", "other": "Bob"})
    found = log(
        seen(1, "dashboard", "take_over", phrase, by="Ann", other="Bob"),
        seen(2, "teleop", "take_over", Phrase("control.asked", {"by": "Cy", "other": "web"})),
        seen(3, "dashboard", "take", Phrase("event.take", {"by": "Dee"}), by="Dee"),
        seen(4, "dashboard", "leave", Phrase("event.leave", {"by": "Dee"}), by="Dee"),
    )
    assert [(row.kind, row.by) for row in found] == [
        ("takeover", "Ann"), ("takeover", "Cy"), ("takeover", "Dee"), ("takeover", "Dee")
    ]  # fmt: skip
    assert found[0].text == "Ann takes control from Bob."
    assert found[3].text == "Dee no longer has control."


def test_a_silent_board_and_the_end_of_driving_in_sight_are_notes() -> None:
    found = log(
        seen(1, "bridge", "link_lost", Phrase("event.link_lost")),
        seen(4, "bridge", "link_up", Phrase("event.link_up")),
        seen(5, "bridge", "link_up", Phrase("event.link_up")),
        seen(2, "dashboard", "by_picture", Phrase("event.by_picture", {"by": "Ann"}), by="Ann"),
    )
    assert texts(found) == [
        "note: The board is silent: STOP is being sent.",
        "note: Ann drives by the picture.",
    ]
    assert [row.end_ns for row in found] == [ns(4), 0]


def test_a_round_is_one_row_with_its_route_and_result() -> None:
    start = seen(10, "patrol", "round_start", Phrase("patrol.announcing", {"route": "yard"}))
    stopped = seen(20, "patrol", "round_stopped", Phrase("patrol.safety_silent"), level="warning")
    aborted = seen(30, "patrol", "round_end", Phrase("patrol.aborted"), level="warning")
    found = log(start, stopped, aborted)
    assert texts(found) == [
        "round: Round on yard. The round was aborted: drive the vehicle home.",
        "round: Safety is silent.",
    ]
    assert found[0].t_ns == ns(10)
    assert (found[0].end_ns, found[0].level) == (ns(30), "warning")
    (row,) = log(start)
    assert row.text == "Round on yard. Its end is not recorded."


def test_routine_stops_are_left_out() -> None:
    def stop(cause: str, level: Level = "warning") -> Seen:
        return seen(1, "safety", "stop", Phrase("silent.stalled"), level=level, cause=cause)

    assert log(stop("blocked"), stop("limit_stop"), stop("no_request", "info")) == []
    (row,) = log(stop("silent"))
    assert (row.kind, row.level) == ("stop", "warning")


def test_the_same_event_of_two_recordings_is_one_row() -> None:
    one = latch(10)
    (row,) = log(one, one._replace(at_ns=ns(9.8)))
    assert row.t_ns == ns(10)


def test_the_black_box_is_named_at_its_stop() -> None:
    box = seen(25, "recorder", "black_box", file="/x/001-latch-contact.mcap")
    (row,) = log(latch(10), reset(20), box)
    assert row.recording == "001-latch-contact.mcap"
    (row,) = log(latch(10), box._replace(at_ns=ns(10 + HOUR_S)))
    assert row.recording == ""


def test_long_names_are_cut_and_unknown_phrases_replaced_by_the_text() -> None:
    long = "n" * 4000
    (row,) = log(asked(1, "take_over", long))
    assert row.by == "n" * (NAME_MAX - 1) + "…"
    assert len(row.text) < 200
    (row,) = log(seen(1, "dashboard", "in_sight", Phrase("of a newer version"), text="As it is."))
    assert render(row.phrases, "zh") == row.text == "As it is."


@pytest.mark.parametrize(
    ("service", "name", "logged"),
    [
        ("safety", "contact", True),
        ("bridge", "contact", False),
        ("mine", "reset", False),
        ("odom", "slip", False),
    ],
)
def test_only_events_of_their_own_service_are_logged(
    service: str, name: EventName, logged: bool
) -> None:
    assert is_logged(service, seen(1, service, name).event) is logged


def gaps(
    *spans: tuple[float, float], since: float | None = None, until: float | None = None
) -> list[tuple[float, float]]:
    edges = {"since_ns": since, "until_ns": until}
    limits = {name: None if each is None else ns(each) for name, each in edges.items()}
    given = [Span(ns(begin), ns(end)) for begin, end in spans]
    found = rows("001", [], given, **limits)
    return [(row.t_ns / NS_PER_S, row.end_ns / NS_PER_S) for row in found[::-1]]


def test_times_without_a_record_are_rows() -> None:
    assert gaps((0, 100), (105, 200)) == []  # a restart
    assert gaps((300, 400), (0, 100), (50, 90)) == [(100, 300)]
    assert gaps((300, 400), since=200, until=700) == [(200, 300), (400, 700)]
    assert gaps((300, 400), since=350, until=405) == []
    assert gaps((0, 100), (300, 400), since=250) == [(100, 300)]
    assert gaps((0, 100), (300, 400), since=350) == []
    assert gaps(since=0, until=100) == [(0, 100)]


def test_rows_that_end_before_the_time_are_left_out() -> None:
    events = [latch(10), reset(100), latch(200), reset(210)]
    found = rows("001", events, [Span(0, ns(300))], since_ns=ns(50))
    assert [row.t_ns for row in found] == [ns(200), ns(10)]
    assert len(rows("001", events, [Span(0, ns(300))], since_ns=ns(150))) == 1
