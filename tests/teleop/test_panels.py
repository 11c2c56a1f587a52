"""Texts of the panels."""

import pytest

from common.messages import Bumper, Cause, Direction
from common.motion import Twist
from services.teleop import panels
from services.teleop.round_trip import UNKNOWN, multiplexer
from services.teleop.view import Line
from tests.factories import contact_state, link, release, safety_state
from tests.teleop.support import view

CONTACT = Cause(name="contact", action="brake", age=12.4, text="The bumper was hit.")
SILENT = Cause(name="silent", action="stop", age=300.0, text="An input is too old.")
IDLE = Cause(name="no_request", action="stop", age=1.0, text="No source requests motion.")


def test_the_header_shows_the_connections() -> None:
    words = panels.header(view(link=link(), bumper=Bumper(pressed=False))).plain
    assert words == "T2 001  ● bus  ● board  ● bumper  gear 1/5  0.20 m/s 0.30 rad/s"


def test_the_header_fits_without_data() -> None:
    words = panels.header(view(connected=False)).plain
    assert "no router yet" in words
    assert "no bridge" in words
    assert len(words) <= 78


@pytest.mark.parametrize(("state", "words"), [("lost", "board lost"), ("never", "never seen")])
def test_the_header_shows_a_missing_board(state: str, words: str) -> None:
    assert words in panels.header(view(link=link(state=state))).plain


def test_the_header_shows_turbo_and_a_pressed_bumper() -> None:
    words = panels.header(view(turbo=True, top=Twist(1, 1), bumper=Bumper(pressed=True))).plain
    assert "TURBO  1.00 m/s" in words
    assert "PRESSED" in words


def test_a_missing_safety_is_shown() -> None:
    assert "NO SAFETY" in panels.safety(view(), 2).plain


def test_without_a_router_the_connection_is_named() -> None:
    assert "no connection to the router" in panels.safety(view(connected=False), 2).plain


def test_an_alarm_comes_first() -> None:
    words = panels.safety(view(alarm="NOT CONFIRMED", safety=safety_state(text="Stands.")), 3)
    assert words.plain.split("\n")[0] == "NOT CONFIRMED"
    assert "Stands." in words.plain


def test_the_help_names_every_key_of_the_hints() -> None:
    words = panels.help_text().plain
    for key in ("W A S D", "Z C", "space", "E", "R", "F B", "1 to 5", "T", "[ ]", "Q"):
        assert f"\n{key}" in f"\n{words}", key
    assert max(map(len, words.split("\n"))) <= 76


def test_the_text_of_safety_is_shown() -> None:
    words = panels.safety(view(safety=safety_state(verdict="slow", text="Slowed.")), 2).plain
    assert words == " SLOW   Slowed."


def test_latched_causes_come_first_with_advice() -> None:
    state = safety_state(
        verdict="brake", latched=("contact",), causes=(SILENT, CONTACT, IDLE), text="No."
    )
    assert panels.safety(view(safety=state), 5).plain.split("\n")[1:] == [
        "LATCHED The bumper was hit. 12 s, R resets",
        "stop An input is too old. 5 min",
    ]


def test_with_few_rows_causes_are_named_in_one_line() -> None:
    state = safety_state(latched=("contact",), causes=(SILENT, CONTACT))
    lines = panels.safety(view(safety=state), 2).plain.split("\n")
    assert lines[1:] == ["LATCHED contact 12 s, R resets  stop silent 5 min"]


def test_the_newest_events_are_shown() -> None:
    lines = tuple(Line(0, "bridge", "warning", f"event {number}") for number in range(5))
    shown = panels.events(view(lines=lines), 2).plain.split("\n")
    assert [line[9:] for line in shown] == ["bridge  event 3", "bridge  event 4"]
    assert panels.events(view(lines=lines), 0).plain == ""
    older = panels.events(view(lines=lines), 2, skipped=2).plain.split("\n")
    assert [line[9:] for line in older] == ["bridge  event 1", "bridge  event 2"]
    assert panels.events(view(lines=lines), 9).plain.count("event") == 5


def test_a_long_line_is_wrapped() -> None:
    lines = (Line(0, "bridge", "info", "short"), Line(0, "safety", "error", "word " * 30))
    shown = panels.events(view(lines=lines), 5, 76).plain.split("\n")
    assert [len(row) for row in shown] == [22, 76, 76, 46]
    assert shown[2].startswith(" " * 17 + "word")
    cut = panels.events(view(lines=lines), 2, 76).plain.split("\n")
    assert cut == shown[1:3]  # the beginning has the most important part
    assert panels.events(view(lines=(Line(0, "safety", "info", ""),)), 2, 10).plain.strip()


def test_the_hints_explain_key_repeats_and_fit() -> None:
    keys, limit = panels.hints(view(), 0.6, 0.3).plain.split("\n")
    assert "E ESTOP" in keys
    assert "FB release" in keys
    assert "a tap drives 0.6 s, a hold 0.3 s past its last repeat" in limit
    assert max(len(keys), len(limit)) <= 78


@pytest.mark.parametrize(
    "reason",
    [
        "terminal too slow: 10.42 s, allowed 0.15 s",
        UNKNOWN,
        multiplexer({"ZELLIJ": "0", "SSH_TTY": "/dev/pts/0"}, ()),
        multiplexer({}, ["mosh-server"]),
    ],
)
def test_on_a_slow_terminal_the_hints_give_the_reason_and_the_accepted_keys(reason: str) -> None:
    keys, advice = panels.hints(view(keys_refused=reason), 0.6, 0.3).plain.split("\n")
    assert keys == f"␣ stop E ESTOP Q quit  KEYS OFF: {reason}"
    assert "dashboard" in advice
    assert max(len(keys), len(advice)) <= 78


def contact_rows(rows: int = 4, held: Direction | None = None, **fields: object) -> list[str]:
    state = contact_state(release=release(**fields))
    return panels.safety(view(safety=state, release=held), rows).plain.split("\n")


def test_a_contact_says_which_way_is_believed_free_and_from_what() -> None:
    assert contact_rows() == [
        " BRAKE   The bumper is pressed.",
        "RELEASE  believed free: BACKWARD (moved forward, 12 s ago; net +0.43 m)",
        " F  forward    B  backward   0.12 m left until reset",
        "LATCHED The bumper was hit. 12 s, R resets",
    ]


def test_the_other_way_and_an_unknown_age() -> None:
    row = contact_rows(believed_free="forward", travelled=-0.2, age=None)[1]
    assert row == "RELEASE  believed free: FORWARD (moved backward; net -0.20 m)"


def test_an_unknown_free_direction_is_shown() -> None:
    row = contact_rows(believed_free=None, age=None)[1]
    assert row == "RELEASE  free direction unknown: look at the vehicle"


def test_a_forbidden_direction_and_the_held_one_are_shown() -> None:
    row = contact_rows(held="backward", forbidden=("forward",), left=0.0)[2]
    assert row == " F  forward FORBIDDEN    B  backward, held   0.00 m left until reset"


def test_a_free_bumper_needs_no_release() -> None:
    state = contact_state(release=release())
    for pressed in (True, False):
        text = panels.safety(view(safety=state, bumper=Bumper(pressed=pressed)), 6).plain
        assert ("RELEASE" in text) == pressed


def test_the_release_fits() -> None:
    rows = contact_rows(
        believed_free="forward", age=7000.0, travelled=-0.999, forbidden=("forward", "backward")
    )
    assert len(rows) == 4
    assert max(map(len, rows)) <= 76
