"""Moving off a pressed bumper, through the whole decision."""

import pytest

from common.messages import Direction
from common.operator import BUMPER_FREE
from services.safety.inputs import Hold
from services.safety.latches import latched
from services.safety.state import Reply
from tests.safety.policy_fixture import (
    CHOOSE_TEXT,
    DIRECTIONS,
    NO_ECHO_TEXT,
    USED_UP_TEXT,
    PolicyFixture,
    hit,
    link,
)

LET_GO = "The release was ended after this call was made: hold it again."
OTHER = "The release is held in the other direction: release the key first."


@pytest.mark.parametrize(("direction", "sign"), [("forward", 1), ("backward", -1)])
def test_a_held_release_moves_as_chosen_and_no_farther_than_its_way(
    direction: Direction, sign: int
) -> None:
    fixture, began = hit(), hit().distance
    for _ in range(300):
        fixture.tick()
        if fixture.hold(direction=direction):
            break
        if fixture.verdict.command == "run":
            assert 0 <= sign * fixture.verdict.twist.linear <= 0.1 + 1e-9
            assert fixture.verdict.twist.angular == 0
            assert fixture.verdict.source == "release"
    fixture.tick(40)
    assert 0.1 < sign * (fixture.distance - began) <= 0.15
    for either in DIRECTIONS:
        assert fixture.hold(direction=either) == USED_UP_TEXT
    assert fixture.tick().command == "brake"
    assert "contact" in latched(fixture.state.latches)


def test_the_operator_has_to_choose_a_direction() -> None:
    fixture = hit()
    assert fixture.hold(direction=None) == CHOOSE_TEXT
    assert fixture.tick(3).command == "brake"
    assert fixture.hold() == ""
    assert fixture.tick(3).command == "run"
    assert fixture.hold(direction=None) == CHOOSE_TEXT
    assert fixture.verdict.command == "brake"  # a wrong call ends it


def test_a_release_that_is_let_go_ends() -> None:
    fixture = hit()
    assert fixture.hold() == ""
    assert fixture.tick(5).command == "run"
    assert fixture.hold(held=False) == ""
    assert fixture.verdict.command == "brake"
    assert fixture.hold() == LET_GO  # it echoes no newer state than the call that let go
    fixture.linear = -0.05
    fixture.tick()
    assert fixture.hold() == "The vehicle still moves."
    fixture.linear = None
    fixture.tick()
    assert fixture.hold() == ""
    assert fixture.tick(10).command == "run"
    assert fixture.tick(6).command == "brake"  # not repeated within its lease


def test_calls_that_were_overtaken_by_the_one_that_let_go_do_not_hold_again() -> None:
    fixture = hit()
    fixture.hold()
    fixture.tick(3)
    early = fixture.echo
    fixture.tick(3)
    fixture.hold(held=False)
    fixture.tick(10)
    for echo in (early, early + 3):
        assert fixture.hold(echo=echo) == LET_GO
        assert fixture.verdict.command == "brake"
    assert fixture.hold(echo=early + 4) == ""


@pytest.mark.parametrize("echo", [None, 2**62, -5])
def test_whoever_lets_go_is_obeyed_and_later_calls_count_again(echo: int | None) -> None:
    fixture = hit()
    assert fixture.hold() == ""
    assert fixture.tick(5).command == "run"
    assert fixture.decide(Hold(False, None, echo)).command == "brake"
    fixture.tick()
    assert fixture.hold() == ""
    assert fixture.tick(5).command == "run"


def test_a_change_of_direction_begins_at_rest() -> None:
    fixture = hit()
    fixture.linear = 0.0  # held by what it hit: measured, it stands all the time
    fixture.hold()
    assert fixture.tick(10).twist.linear < 0
    assert fixture.hold(direction="forward") == OTHER
    assert fixture.verdict.command == "brake"
    fixture.tick()
    assert fixture.hold(direction="forward") == ""
    for _ in range(10):
        assert fixture.verdict.twist.linear >= 0
        fixture.tick()
    assert fixture.verdict.twist.linear > 0
    fixture.linear = 0.05
    assert fixture.tick(20).command == "brake"
    assert fixture.hold(direction="backward") == "The vehicle still moves."


def test_late_calls_move_nothing_and_change_nothing() -> None:
    fixture = hit()
    old = fixture.echo
    fixture.tick(100)
    for number in range(20):
        assert fixture.hold(echo=old + number).startswith("The call is ")
        assert fixture.verdict.command == "brake"
    assert fixture.hold(echo=-7).startswith("The call echoes an unknown heartbeat")
    assert fixture.decide(Hold(True, "backward")).reply == Reply(False, NO_ECHO_TEXT)
    assert fixture.hold() == ""
    assert fixture.tick(3).command == "run"
    assert fixture.hold(echo=old) != ""
    assert fixture.verdict.command == "run"  # a hold that is granted continues


@pytest.mark.parametrize(("ticks", "allowed"), [(20, True), (21, False)])
def test_a_hold_is_no_older_than_a_request(ticks: int, allowed: bool) -> None:
    fixture = hit()
    old = fixture.echo
    fixture.tick(ticks)
    assert (fixture.hold(echo=old) == "") == allowed


def test_a_release_ends_when_the_bumper_is_free() -> None:
    fixture = hit()
    fixture.hold()
    fixture.pressed = False
    assert fixture.tick().command == "brake"
    assert fixture.decide(Hold(True, "backward", fixture.echo)).reply == Reply(True, BUMPER_FREE)
    assert fixture.tick().command == "brake"
    fixture.hold(held=False)
    fixture.pressed = True
    assert fixture.tick(5).command == "brake"


def test_a_release_does_not_go_on_when_the_bumper_is_pressed_anew() -> None:
    fixture = hit()
    fixture.hold()
    fixture.tick()
    fixture.pressed = False
    fixture.tick()
    fixture.pressed = True
    assert fixture.tick().command == "brake"  # within the lease of the call
    assert fixture.tick(3).command == "brake"


def test_a_release_goes_nowhere_without_its_conditions() -> None:
    assert PolicyFixture().ready().hold() == "There is no contact to release."
    fixture = hit()
    fixture.estop()
    assert fixture.hold() == "Emergency stop."
    fixture.tick(3)
    assert fixture.hold() == "Emergency stop. Reset first."
    fixture = hit()
    fixture.link = link("lost")
    fixture.tick()
    assert fixture.hold() == "The link to the board is lost."
    fixture = hit()
    fixture.linear = 0.3
    fixture.tick()
    assert fixture.hold() == "The vehicle still moves."


def test_a_release_wants_a_velocity_that_is_young() -> None:
    fixture = hit()
    fixture.muted = {"velocity"}
    fixture.tick(11)
    assert fixture.hold() == "No recent data: velocity."


def test_a_release_obeys_the_sonars() -> None:
    fixture = hit()
    fixture.sonar(rear=0.1)
    fixture.tick()
    assert fixture.hold() == ""
    assert fixture.tick(3).command == "stop"
    assert "blocked" in fixture.state.latches


def test_a_release_that_a_faulty_sonar_blocks_gives_no_advice_for_sources() -> None:
    fixture = hit()
    fixture.sonar(rear=None)
    fixture.tick()
    assert fixture.hold() == ""
    assert fixture.tick(3).command == "stop"
    text = fixture.state.latches["blocked"].text
    assert text == "No motion toward the rear: that sonar is faulty."


def test_a_release_is_refused_while_two_publishers_bar_motion() -> None:
    fixture = hit()
    for boot in (1, 2):
        fixture.driver_boot = boot
        fixture.request()
    assert fixture.hold() == "Two publishers use teleop."
    assert fixture.tick(3).command == "brake"
    fixture.tick(40)
    assert fixture.hold() == ""
    for boot in (3, 4):  # a release that is held ends, too
        fixture.driver_boot = boot
        fixture.request()
    assert fixture.hold() == "Two publishers use teleop."
    assert fixture.verdict.command == "brake"
