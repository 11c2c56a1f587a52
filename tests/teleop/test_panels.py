"""Texts of the panels."""

from typing import Any

import pytest

from services.teleop import panels
from t2.client import request
from t2.messages import (
    Bumper,
    Cause,
    Drive,
    Driver,
    Limits,
    Velocity,
)
from tests.factories import contact_state, link, odometry, release, safety_state
from tests.teleop.support import view

CONTACT = Cause(name="contact", action="brake", age=12.4, text="The bumper was hit.")
SILENT = Cause(name="silent", action="stop", age=300.0, text="An input is too old.")
NEXT = "To stop, use the vehicle's own switch. Next: `t2 doctor`"
IDLE = Cause(name="no_request", action="stop", age=1.0, text="No source requests motion.")


# --- safety ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "rows", "expected"),
    [
        (
            {"router": "tcp/a:1"},
            2,
            [" NO SAFETY  no state of safety arrives through tcp/a:1", NEXT],
        ),
        (
            {"router": "tcp/a:1", "connected": False},
            2,
            [" NO ROUTER  no answer at tcp/a:1", NEXT],
        ),
        (
            {"alarm": "NOT CONFIRMED", "safety": safety_state(text="Stands.")},
            3,
            ["NOT CONFIRMED", " RUN  Stands."],
        ),
        (
            {
                "safety": safety_state(
                    verdict="brake",
                    latched=("contact",),
                    causes=(SILENT, CONTACT, IDLE),
                    text="No.",
                ),
                "link": link(),
            },
            3,
            [
                " BRAKE  No.",
                "LATCHED The bumper was hit. 12 s",
                "stop An input is too old. 5 min",
            ],
        ),
        (  # what follows from a silent board is folded
            {
                "safety": safety_state(latched=("contact",), causes=(SILENT, CONTACT)),
                "link": link(state="lost"),
            },
            3,
            [
                " RUN  The board is silent: check its power and cable. Next: `t2 doctor`",
                "LATCHED The bumper was hit. 12 s",
            ],
        ),
        (  # with few rows the causes are named in one line
            {
                "safety": safety_state(latched=("contact",), causes=(SILENT, CONTACT)),
                "link": link(),
            },
            2,
            [" RUN  Driving.", "LATCHED contact 12 s  stop silent 5 min"],
        ),
    ],
)
def test_alarm_verdict_and_causes(fields: dict[str, Any], rows: int, expected: list[str]) -> None:
    assert panels.safety(view(**fields), rows).plain.split("\n") == expected


def test_alarm_and_verdict_are_wrapped() -> None:
    state = contact_state(text="It is still pressed: move off first, then reset.", release=None)
    shown = panels.safety(view(alarm="NOT CONFIRMED: use the switch", safety=state), 2, 28)
    assert shown.plain.split("\n") == [
        "NOT CONFIRMED: use the",
        "switch",
        " BRAKE  It is still pressed:",
        "move off first, then reset.",
        "LATCHED The bumper was hit. 12 s",
    ]


def test_the_operator_in_control_is_you() -> None:
    state = safety_state(text="teleop is in control.")
    assert panels.safety(view(safety=state), 2).plain == " RUN  teleop is in control."  # another
    ours = view(safety=state, requested=Drive(linear=0.0, angular=0.0, echo=0))
    assert panels.safety(ours, 2).plain == " RUN  You are in control."


@pytest.mark.parametrize(
    "fields",
    [
        {"safety": contact_state(release=release(left=0.0))},
        {"safety": contact_state(release=release(forbidden=("backward", "forward")))},
        {"safety": contact_state(), "link": link(state="lost")},
        {"safety": contact_state(), "bumper": Bumper(pressed=False)},
    ],
)
def test_no_release_is_offered_that_safety_refuses(fields: dict[str, Any]) -> None:
    assert panels.release(view(**fields)) == []
    assert panels.release(view(safety=contact_state(), link=link()))


def test_a_contact_says_which_way_is_believed_free_and_from_what() -> None:
    shown = panels.safety(view(safety=contact_state(), requested=request()), 4).plain
    assert shown.split("\n") == [
        " BRAKE  The bumper is pressed.",
        "RELEASE  believed free: BACKWARD (moved forward, 12 s ago; net +0.43 m)",
        " F  forward    B  backward   0.12 m left until reset",
        "LATCHED The bumper was hit. 12 s",
    ]


@pytest.mark.parametrize(
    ("fields", "keys"),
    [
        ({}, ["WASD drive ␣ stop 1-5 gear E ESTOP R reset FB release ZC arcs Q quit", "No key-up"]),
        ({"keys_refused": "slow"}, ["␣ stop E ESTOP Q quit  KEYS OFF: slow", "Use"]),
        (
            {"key_notice": "key ц has no function: SWITCH"},
            ["WASD drive", "Key ц has no function: SWITCH"],
        ),
        ({"keys_muted": True}, ["WASD drive", "KEYS OFF: release all keys for 0.6 s"]),
        ({"may_drive": False, "keys_refused": "slow"}, ["E ESTOP Q quit"]),
        ({"may_drive": False, "may_stop": False}, ["Q quit"]),
    ],
)
def test_the_footer_has_the_keys_that_have_an_effect(
    fields: dict[str, Any], keys: list[str]
) -> None:
    shown = panels.hints(view(**fields), 0.6).plain.split("\n")
    assert [line[: len(key)] for line, key in zip(shown, keys, strict=True)] == keys


# --- motion ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({}, {"pose": "no data", "odom": "no data", "board": "no data"}),
        ({"odometry": odometry(residual=None, slip=True)}, {"odom": "residual -  SLIP"}),
        ({"link": link(armed=False, waiting="a neutral motion")}, {"board": "a neutral motion"}),
        (
            {
                "left": Driver(faults=(), bits=0),
                "right": Driver(faults=("encoder", "bit_9"), bits=516),
            },
            {"motor L": "ok", "motor R": "encoder bit_9"},
        ),
        ({"requested": request(release="forward")}, {"driver": "you, release forward"}),
        ({"gamepad": "Pad", "gamepad_notice": "MOVE THE STICK"}, {"gamepad": "MOVE THE STICK"}),
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
    lines = panels.motion(view(**fields)).plain.split("\n")
    assert len(lines) == 10
    assert max(map(len, lines)) <= 40
    shown = {line[:8].strip(): line[8:].strip() for line in lines}
    assert {name: shown[name] for name in expected} == expected
