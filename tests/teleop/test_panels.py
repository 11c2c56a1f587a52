"""Texts of the panels."""

from typing import Any

import pytest

from common.client import request
from common.messages import (
    Bumper,
    Cause,
    Driver,
    Limits,
    ReleaseRequest,
    Velocity,
)
from services.teleop import panels
from services.teleop.view import View
from tests.factories import contact_state, link, odometry, release, safety_state
from tests.teleop.support import view

CONTACT = Cause(name="contact", action="brake", age=12.4, text="The bumper was hit.")
SILENT = Cause(name="silent", action="stop", age=300.0, text="An input is too old.")
IDLE = Cause(name="no_request", action="stop", age=1.0, text="No source requests motion.")


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
        (  # a free bumper needs no release
            {"safety": contact_state(release=release()), "bumper": Bumper(pressed=False)},
            2,
            [" BRAKE   The bumper is pressed.", "LATCHED The bumper was hit. 12 s, R resets"],
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
        (
            {
                "requested": request(-0.35, 0.1),
                "safety": safety_state(limits=Limits(forward=0.22, backward=0.5, angular=0.9)),
                "velocity": Velocity(linear=0.21, angular=-0.02),
            },
            {
                "m/s": "-0.35     0.50     +0.21",
                "rad/s": "+0.10     0.90     -0.02",
            },
        ),
    ],
)
def test_rows_of_the_motion_panel(fields: dict[str, Any], expected: dict[str, str]) -> None:
    shown = table(view(**fields))
    assert len(shown) == 10
    assert {name: shown[name] for name in expected} == expected
