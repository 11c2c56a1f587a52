"""Texts of the panels."""

from typing import Any

import pytest
from rich.cells import cell_len

from services.teleop import panels
from services.teleop.core.keystroke import no_function
from services.teleop.labels import LABELS, Labels
from t2 import catalogue
from t2.client import request
from t2.messages import (
    Bumper,
    Cause,
    Drive,
    Driver,
    Limits,
    Phrase,
    Velocity,
)
from t2.words import PLACEHOLDER
from tests.factories import contact_state, link, map_pose, odometry, release, safety_state
from tests.teleop.support import view

SAY = Labels()
MAY_MOVE = (Phrase("root.may_move"),)

CONTACT = Cause(name="contact", action="brake", age=12.4, text="The bumper was hit.")
SILENT = Cause(name="silent", action="stop", age=300.0, text="An input is too old.")
SWITCH = "To stop the vehicle, use its own switch."
UNKNOWN = "It may drive by itself: this terminal does not know. Look at it, then call a technician."
TOLD = (
    "It is told to stop within a second, unless another program drives it. Is it on, and its "
    "network? Then call a technician."
)
IDLE = Cause(name="no_request", action="stop", age=1.0, text="No command to drive.")


# --- safety ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "rows", "expected"),
    [
        (
            {"router": "tcp/a:1"},
            2,
            [
                f" NO SAFETY  {SWITCH} {UNKNOWN}",
                "For the technician: no state of safety arrives through tcp/a:1. Next: `t2 doctor`",
            ],
        ),
        (
            {"router": "tcp/a:1", "connected": False},
            2,
            [
                f" NO CONNECTION TO THE ROBOT  {SWITCH} {TOLD}",
                "For the technician: no answer at tcp/a:1. Next: `t2 doctor`",
            ],
        ),
        (
            {"alarm": MAY_MOVE, "safety": safety_state(text="Stands.")},
            3,
            ["The vehicle may still move: use its own switch.", " RUN  Stands."],
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
                "RESET NEEDED The bumper was hit. 12 s",
                "stop An input is too old. 5 min",
            ],
        ),
        (
            {
                "safety": safety_state(text="You drive."),
                "velocity": Velocity(linear=0.4, angular=0.0),
            },
            1,
            [" RUN +0.40 m/s  You drive."],
        ),
        (  # what follows from a silent board is folded
            {
                "safety": safety_state(latched=("contact",), causes=(SILENT, CONTACT)),
                "link": link(state="lost"),
            },
            3,
            [
                " RUN  The board is silent: check its power and cable. Next: `t2 doctor`",
                "RESET NEEDED The bumper was hit. 12 s",
            ],
        ),
        (  # with few rows the causes are named in one line
            {
                "safety": safety_state(latched=("contact",), causes=(SILENT, CONTACT)),
                "link": link(),
            },
            2,
            [" RUN  Driving.", "RESET NEEDED contact 12 s  stop old data 5 min"],
        ),
    ],
)
def test_alarm_verdict_and_causes(fields: dict[str, Any], rows: int, expected: list[str]) -> None:
    assert panels.safety(view(**fields), SAY, rows).plain.split("\n") == expected


def test_alarm_and_verdict_are_wrapped() -> None:
    state = contact_state(text="It is still pressed: move off first, then reset.", release=None)
    shown = panels.safety(view(alarm=MAY_MOVE, safety=state), SAY, 2, 28)
    assert shown.plain.split("\n") == [
        "The vehicle may still move:",
        "use its own switch.",
        " BRAKE  It is still pressed:",
        "move off first, then reset.",
        "RESET NEEDED The bumper was hit. 12 s",
    ]


def test_the_operator_in_control_is_you() -> None:
    why = (Phrase("control.of", {"source": "teleop"}),)
    state = safety_state(text="teleop is in control.", phrases=why)
    assert (
        panels.safety(view(safety=state), SAY, 2).plain == " RUN  teleop (terminal) is in control."
    )  # another
    ours = view(safety=state, requested=Drive(linear=0.0, angular=0.0, echo=0))
    assert panels.safety(ours, SAY, 2).plain == " RUN  You are in control."


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
    assert panels.release(view(**fields), SAY) == []
    assert panels.release(view(safety=contact_state(), link=link()), SAY)


def test_a_contact_says_which_way_is_believed_free_and_from_what() -> None:
    shown = panels.safety(view(safety=contact_state(), requested=request()), SAY, 4).plain
    assert shown.split("\n") == [
        " BRAKE  The bumper is pressed.",
        "RELEASE  believed free: BACKWARD (moved forward, 12 s ago; net +0.43 m)",
        " F  forward    B  backward   0.12 m left until reset",
        "RESET NEEDED The bumper was hit. 12 s",
    ]


@pytest.mark.parametrize(
    ("fields", "keys"),
    [
        ({}, ["WASD drive ␣ stop 1-5 gear E ESTOP R reset FB release ZC arcs Q quit", "No key-up"]),
        (
            {"keyboard_refused": (Phrase("terminal.unknown"),)},
            ["␣ stop E ESTOP Q quit  KEYBOARD OFF: Terminal delay unknown: ", "Use"],
        ),
        (
            {"keystroke_notice": no_function("ц")},
            ["WASD drive", "ц has no function here. SWITCH THE KEYBOARD"],
        ),
        ({"keyboard_muted": True}, ["WASD drive", "KEYBOARD OFF: let go of it for 0.6 s"]),
        ({"may_drive": False, "keyboard_refused": MAY_MOVE}, ["E ESTOP Q quit"]),
        ({"may_drive": False, "may_stop": False}, ["Q quit"]),
    ],
)
def test_the_footer_has_the_keys_that_have_an_effect(
    fields: dict[str, Any], keys: list[str]
) -> None:
    shown = panels.hints(view(**fields), SAY, 0.6).plain.split("\n")
    assert [line[: len(key)] for line, key in zip(shown, keys, strict=True)] == keys


# --- motion ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({}, {"pose": "no data", "odom": "no data", "board": "no data"}),
        ({"odometry": odometry(residual=None, slip=True)}, {"odom": "residual -  SLIP"}),
        (
            {"odometry": odometry(), "map_pose": map_pose("unplaced")},
            {"pose": "x +1.23  y -0.40 m  +90°"},
        ),
        ({"odometry": odometry(), "map_pose": map_pose()}, {"map": "x +4.00  y +2.00 m  +29°"}),
        (
            {"odometry": odometry(), "map_pose": map_pose("lost")},
            {"map": "LOST x +4.00  y +2.00 m  +29°"},
        ),
        ({"link": link(armed=False, waiting="a neutral motion")}, {"board": "a neutral motion"}),
        (
            {
                "left": Driver(faults=(), bits=0),
                "right": Driver(faults=("encoder", "bit_9"), bits=516),
            },
            {"motor L": "ok", "motor R": "encoder, bit 9"},
        ),
        ({"requested": request(release="forward")}, {"driver": "you, release forward"}),
        ({"gamepad_notice": (Phrase("gamepad.due"),)}, {"gamepad": "no change: MOVE THE STICK"}),
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
    lines = panels.motion(view(**fields), SAY).plain.split("\n")
    assert len(lines) == 10
    assert max(map(len, lines)) <= 40
    shown = {line[:8].strip(): line[8:].strip() for line in lines}
    assert {name: shown[name] for name in expected} == expected


# --- labels ---------------------------------------------------------------------------------


def test_each_label_has_one_home_and_the_same_fields_in_both_languages() -> None:
    assert LABELS.keys().isdisjoint(catalogue.TEXTS)
    for english, chinese in LABELS.values():
        assert sorted(PLACEHOLDER.findall(english)) == sorted(PLACEHOLDER.findall(chinese)), english
    with pytest.raises(KeyError):
        SAY("no label")


def test_there_are_labels_for_all_causes_and_for_all_that_the_bridge_waits_for() -> None:
    assert {f"cause.{name}" for name in catalogue.CAUSES} <= LABELS.keys()
    long = {name for name in catalogue.PHRASES if name.startswith(("waiting.", "relay."))}
    assert {f"short.{name}" for name in long - {"waiting.no_confirmation"}} <= LABELS.keys()
    for name, texts in LABELS.items():
        if name.startswith("short."):
            assert max(map(cell_len, texts)) <= panels.VALUE
