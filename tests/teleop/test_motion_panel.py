"""The motion panel."""

import pytest

from common.messages import Direction, Driver, Limits, Velocity
from common.motion import Twist
from services.teleop.motion_panel import motion
from services.teleop.view import View
from tests.factories import contact_state, link, odometry, safety_state
from tests.teleop.support import view


def rows(of: View) -> dict[str, str]:
    return {line[:8].strip(): line[8:].strip() for line in motion(of).plain.split("\n")}


def test_it_fits_between_its_borders() -> None:
    full = view(link=link(), odometry=odometry(), safety=safety_state(), gamepad="none")
    for of in (view(), full):
        lines = motion(of).plain.split("\n")
        assert len(lines) == 11
        assert max(len(line) for line in lines) <= 40


def test_without_data_no_values_are_shown() -> None:
    table = rows(view())
    assert table["m/s"].split() == ["-", "-", "-"]
    assert {table[name] for name in ("pose", "odom", "board", "rates", "motor L")} == {"no data"}
    assert table["driver"] == "none"


@pytest.mark.parametrize(("linear", "allowed"), [(0.35, "0.22"), (0.0, "0.22"), (-0.35, "0.50")])
def test_speeds_requested_allowed_and_measured(linear: float, allowed: str) -> None:
    limits = Limits(forward=0.22, backward=0.5, angular=0.9)
    table = rows(
        view(
            requested=Twist(linear, 0.1),
            safety=safety_state(limits=limits),
            velocity=Velocity(linear=0.21, angular=-0.02),
        )
    )
    assert table["m/s"].split() == [f"{linear:+.2f}", allowed, "+0.21"]
    assert table["rad/s"].split() == ["+0.10", "0.90", "-0.02"]


def test_zero_has_no_minus() -> None:
    assert rows(view(requested=Twist(-0.0, -0.0)))["m/s"].split()[0] == "+0.00"


def test_the_pose_and_its_residual() -> None:
    table = rows(view(odometry=odometry()))
    assert table["pose"] == "x +1.23  y -0.40 m  +90°"
    assert table["odom"] == "residual +0.004 m  no slip"
    assert rows(view(odometry=odometry(residual=None, slip=True)))["odom"] == "residual -  SLIP"


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "10.7.5.224:4002  0.8 ms"),
        ({"round_trip": None}, "10.7.5.224:4002"),
        ({"state": "lost"}, "lost: 10.7.5.224:4002"),
        ({"armed": False, "waiting": "a neutral motion"}, "a neutral motion"),
        ({"armed": False}, "not armed"),
    ],
)
def test_the_link_to_the_board(fields: dict[str, object], words: str) -> None:
    assert rows(view(link=link(**fields)))["board"] == words


def test_the_fastest_streams_are_shown() -> None:
    assert rows(view(link=link()))["rates"] == "velo 50 driv 2"
    assert rows(view(link=link(rates={})))["rates"] == "none"


def test_driver_faults_are_named_by_side() -> None:
    table = rows(
        view(left=Driver(faults=(), bits=0), right=Driver(faults=("encoder", "bit_9"), bits=516))
    )
    assert table["motor L"] == "ok"
    assert table["motor R"] == "encoder bit_9"


@pytest.mark.parametrize(
    ("held", "source", "words"),
    [
        (None, None, "none"),
        (None, "teleop", "teleop (you)"),
        (None, "nav", "nav"),
        ("forward", None, "you, release forward"),
        ("backward", None, "you, release backward"),
    ],
)
def test_who_drives(held: Direction | None, source: str | None, words: str) -> None:
    of = view(release=held, safety=safety_state(source=source))
    assert rows(of)["driver"] == words


def test_a_silent_gamepad_asks_to_be_moved() -> None:
    table = rows(view(gamepad="Fake Pad", move_stick=True))
    assert table["gamepad"] == "no event: MOVE THE STICK"


def test_a_contact_takes_the_row_of_the_rates() -> None:
    assert "rates" not in rows(view(link=link(), safety=contact_state()))
    assert len(rows(view(link=link(), safety=contact_state()))) == 10
