"""Texts of the panels."""

from typing import Any

import pytest

from common.client import request
from common.messages import (
    Bumper,
    Cause,
    Driver,
    Limits,
    RangeStatus,
    ReleaseRequest,
    Ultrasonic,
    Velocity,
)
from services.teleop import panels
from services.teleop.core.round_trip import UNKNOWN
from services.teleop.view import Line, View
from tests.factories import contact_state, link, odometry, release, safety_state
from tests.teleop.support import view

CONTACT = Cause(name="contact", action="brake", age=12.4, text="The bumper was hit.")
SILENT = Cause(name="silent", action="stop", age=300.0, text="An input is too old.")
IDLE = Cause(name="no_request", action="stop", age=1.0, text="No source requests motion.")


@pytest.mark.parametrize("reason", ["terminal too slow: 10.42 s, allowed 0.15 s", UNKNOWN])
def test_on_a_slow_terminal_the_hints_give_the_reason_and_the_accepted_keys(reason: str) -> None:
    keys, advice = panels.hints(view(keys_refused=reason), 0.6, 0.3).plain.split("\n")
    assert keys == f"␣ stop E ESTOP Q quit  KEYS OFF: {reason}"
    assert "dashboard" in advice
    assert max(len(keys), len(advice)) <= 78


def test_the_newest_events_are_shown_and_long_ones_wrapped() -> None:
    lines = (
        *(Line(0, "bridge", "warning", f"event {number}") for number in range(5)),
        Line(0, "safety", "error", "word " * 30),
    )
    shown = panels.events(view(lines=lines), 5, 76).plain.split("\n")
    assert [line[9:] for line in shown[:2]] == ["bridge  event 3", "bridge  event 4"]
    assert [len(row) for row in shown[2:]] == [76, 76, 46]
    assert shown[3].startswith(" " * 17 + "word")
    # The beginning has the most important part.
    assert panels.events(view(lines=lines), 2, 76).plain.split("\n") == shown[2:4]
    assert panels.events(view(lines=lines), 0).plain == ""
    assert panels.events(view(lines=(Line(0, "safety", "info", ""),)), 2, 10).plain.strip()


# --- safety ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "rows", "expected"),
    [
        ({}, 2, [" NO SAFETY   no state of safety received; check it with `t2 doctor`"]),
        ({"connected": False}, 2, [" NO ROUTER   no connection to the router"]),
        ({"safety": safety_state(verdict="slow", text="Slowed.")}, 2, [" SLOW   Slowed."]),
        (
            {"alarm": "NOT CONFIRMED", "safety": safety_state(text="Stands.")},
            3,
            ["NOT CONFIRMED", " RUN   Stands."],
        ),
        (
            {
                "safety": safety_state(
                    verdict="brake",
                    latched=("contact",),
                    causes=(SILENT, CONTACT, IDLE),
                    text="No.",
                )
            },
            3,
            [
                " BRAKE   No.",
                "LATCHED The bumper was hit. 12 s, R resets",
                "stop An input is too old. 5 min",
            ],
        ),
        (  # with few rows the causes are named in one line
            {"safety": safety_state(latched=("contact",), causes=(SILENT, CONTACT))},
            2,
            [" RUN   Driving.", "LATCHED contact 12 s, R resets  stop silent 5 min"],
        ),
    ],
)
def test_alarm_verdict_and_causes(fields: dict[str, Any], rows: int, expected: list[str]) -> None:
    assert panels.safety(view(**fields), rows).plain.split("\n") == expected


def contact_rows(rows: int = 4, held: ReleaseRequest = "none", **fields: object) -> list[str]:
    state = contact_state(release=release(**fields))
    return panels.safety(view(safety=state, requested=request(release=held)), rows).plain.split(
        "\n"
    )


def test_a_contact_says_which_way_is_believed_free_and_from_what() -> None:
    assert contact_rows() == [
        " BRAKE   The bumper is pressed.",
        "RELEASE  believed free: BACKWARD (moved forward, 12 s ago; net +0.43 m)",
        " F  forward    B  backward   0.12 m left until reset",
        "LATCHED The bumper was hit. 12 s, R resets",
    ]


@pytest.mark.parametrize(
    ("fields", "row", "words"),
    [
        (
            {"believed_free": "forward", "travelled": -0.2, "age": None},
            1,
            "RELEASE  believed free: FORWARD (moved backward; net -0.20 m)",
        ),
        (
            {"believed_free": None, "age": None},
            1,
            "RELEASE  free direction unknown: look at the vehicle",
        ),
        (
            {"held": "backward", "forbidden": ("forward",), "left": 0.0},
            2,
            " F  forward FORBIDDEN    B  backward, held   0.00 m left until reset",
        ),
    ],
)
def test_the_release_shows_directions_and_distance(
    fields: dict[str, Any], row: int, words: str
) -> None:
    assert contact_rows(**fields)[row] == words


@pytest.mark.parametrize("pressed", [True, False])
def test_a_free_bumper_needs_no_release(pressed: bool) -> None:
    of = view(safety=contact_state(release=release()), bumper=Bumper(pressed=pressed))
    assert ("RELEASE" in panels.safety(of, 6).plain) == pressed


# --- sonars ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("distance", "status", "words", "style"),
    [
        (0.49, "ok", "0.49 m", panels.BAD),
        (0.5, "ok", "0.50 m", panels.WARN),
        (1.0, "ok", "1.00 m", panels.GOOD),
        (None, "fault", "fault", "bold magenta"),
        (None, "too_near", "near", panels.BAD),
        (None, "no_echo", "-", panels.DIM),
        (None, "ok", "-", panels.DIM),
    ],
)
def test_a_reading_has_a_label_and_a_colour(
    distance: float | None, status: RangeStatus, words: str, style: str
) -> None:
    seen = Ultrasonic(ranges=(distance, *(None,) * 7), status=(status, *("fault",) * 7))
    assert panels.reading(seen, 0) == (f"{words:^11}", style)
    assert panels.reading(None, 0) == (f"{'?':^11}", panels.DIM)


@pytest.mark.parametrize(("pressed", "body"), [(True, "BUMPER"), (False, "▲")])
def test_each_sonar_is_at_its_place_around_the_vehicle(pressed: bool, body: str) -> None:
    ranges = tuple(1.0 + at / 10 for at in range(8))
    seen = Ultrasonic(ranges=ranges, status=("ok",) * 8)
    rows = panels.around(view(ultrasonic=seen, bumper=Bumper(pressed=pressed))).plain.split("\n")
    ahead, beside, behind = (rows[row].replace("│", "").split() for row in (0, 2, 4))
    assert ahead == ["1.10", "m", "1.20", "m", "1.30", "m"]
    assert beside == ["1.00", "m", body, "1.40", "m"]
    assert behind == ["1.70", "m", "1.60", "m", "1.50", "m"]
    assert {len(row) for row in rows} == {33}


# --- motion ---------------------------------------------------------------------------------


def table(of: View) -> dict[str, str]:
    """Return the motion panel by the names of its rows."""
    lines = panels.motion(of).plain.split("\n")
    assert max(map(len, lines)) <= 40
    return {line[:8].strip(): line[8:].strip() for line in lines}


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({}, {"pose": "no data", "odom": "no data", "board": "no data"}),
        ({}, {"motor L": "no data", "driver": "none", "m/s": "-        -         -"}),
        ({"odometry": odometry()}, {"pose": "x +1.23  y -0.40 m  +90°"}),
        ({"odometry": odometry()}, {"odom": "residual +0.004 m  no slip"}),
        ({"odometry": odometry(residual=None, slip=True)}, {"odom": "residual -  SLIP"}),
        ({"link": link()}, {"board": "10.7.5.224:4002  0.8 ms"}),
        ({"link": link(state="lost")}, {"board": "lost: 10.7.5.224:4002"}),
        ({"link": link(armed=False, waiting="a neutral motion")}, {"board": "a neutral motion"}),
        (
            {
                "left": Driver(faults=(), bits=0),
                "right": Driver(faults=("encoder", "bit_9"), bits=516),
            },
            {"motor L": "ok", "motor R": "encoder bit_9"},
        ),
        ({"safety": safety_state(source="teleop")}, {"driver": "teleop (you)"}),
        ({"requested": request(release="forward")}, {"driver": "you, release forward"}),
        ({"gamepad": "Pad", "move_stick": True}, {"gamepad": "no event: MOVE THE STICK"}),
        ({"requested": request(-0.0, -0.0)}, {"m/s": "+0.00        -         -"}),
    ],
)
def test_rows_of_the_motion_panel(fields: dict[str, Any], expected: dict[str, str]) -> None:
    shown = table(view(**fields))
    assert len(shown) == 10
    assert {name: shown[name] for name in expected} == expected


@pytest.mark.parametrize(("linear", "allowed"), [(0.35, "0.22"), (0.0, "0.22"), (-0.35, "0.50")])
def test_speeds_requested_allowed_and_measured(linear: float, allowed: str) -> None:
    limits = Limits(forward=0.22, backward=0.5, angular=0.9)
    shown = table(
        view(
            requested=request(linear, 0.1),
            safety=safety_state(limits=limits),
            velocity=Velocity(linear=0.21, angular=-0.02),
        )
    )
    assert shown["m/s"].split() == [f"{linear:+.2f}", allowed, "+0.21"]
    assert shown["rad/s"].split() == ["+0.10", "0.90", "-0.02"]
