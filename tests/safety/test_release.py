"""Moving off a pressed bumper, through the whole decision."""

import math

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import Direction, Mileage
from services.safety.causes import BY_NAME
from services.safety.inputs import Hold
from services.safety.latches import FaultBudget, latched
from services.safety.state import Reply
from tests.safety.policy_fixture import NO_ECHO_TEXT, PolicyFixture, hit, link

HOLD = "The bumper was hit. Hold release to move off, forward or backward."
DIRECTIONS: tuple[Direction, ...] = ("forward", "backward")
LET_GO = "The release was ended after this call was made: hold it again."
OTHER = "The release is held in the other direction: release the key first."
CHOOSE = "Choose the direction of the release: forward or backward."
USED_UP = "The distance for moving off is used up. Push the vehicle off by hand, then reset."
BOTH = "The bumper was pressed in both directions. Push the vehicle off by hand, then reset."


def forbidden(direction: str) -> str:
    return f"Release {direction} is forbidden until a reset: the bumper was pressed that way."


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
        assert fixture.hold(direction=either) == USED_UP
    assert fixture.tick().command == "brake"
    assert "contact" in latched(fixture.state.latches)


def test_the_operator_has_to_choose_a_direction() -> None:
    fixture = hit()
    assert fixture.hold(direction=None) == CHOOSE
    assert fixture.tick(3).command == "brake"
    assert fixture.hold() == ""
    assert fixture.tick(3).command == "run"
    assert fixture.hold(direction=None) == CHOOSE
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


def test_a_rebound_before_the_bumper_does_not_choose_the_direction() -> None:
    fixture = PolicyFixture().running()
    fixture.linear = -0.05
    fixture.tick(2)
    fixture.pressed = True
    fixture.tick()
    fixture.linear = 0.0
    fixture.tick(40)
    fixture.linear = None
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "backward"
    assert release.travelled == pytest.approx(0.75, abs=0.03)
    assert release.age == pytest.approx(0.86, abs=0.05)
    fixture.hold()
    assert fixture.tick(10).twist.linear < 0


def test_pressed_again_while_it_moves_off_it_goes_no_farther_that_way() -> None:
    fixture, runs = hit(), 0
    for _ in range(30):
        fixture.tick()
        assert fixture.hold() == ""
    fixture.pressed = False
    fixture.tick(5)
    fixture.pressed = True
    for _ in range(300):
        runs += fixture.tick().command == "run"
        assert fixture.hold() == forbidden("backward")
    assert runs == 0
    release = fixture.published().release
    assert release is not None
    assert (release.believed_free, release.forbidden) == (None, ("backward",))
    left = release.left
    assert fixture.hold(direction="forward") == ""
    assert fixture.tick(5).twist.linear > 0
    release = fixture.published().release
    assert release is not None
    assert 0 < release.left < left < 0.1
    fixture.pressed = False
    fixture.tick()
    fixture.pressed = True
    fixture.tick(40)
    for either in DIRECTIONS:
        assert fixture.hold(direction=either) == BOTH
    assert fixture.reset() == f"Still present: {BY_NAME['contact'].text} {BOTH}"


def press_again(fixture: PolicyFixture, direction: Direction) -> None:
    """Hold the release in this direction, and free the bumper for one tick."""
    for _ in range(10):
        fixture.tick()
        fixture.hold(direction=direction)
    fixture.pressed = False
    fixture.tick()
    fixture.pressed = True
    fixture.tick(40)


@pytest.mark.parametrize(
    ("pressed_again", "advice"),
    [
        (
            "backward",
            "Hold release forward to move off. The vehicle drove forward into the contact: "
            "check that direction first.",
        ),
        ("forward", "Hold release backward to move off."),
    ],
)
def test_the_advice_names_only_the_direction_that_is_left(
    pressed_again: Direction, advice: str
) -> None:
    fixture = hit()
    press_again(fixture, pressed_again)
    assert fixture.reset() == f"Still present: The bumper was hit. {advice}"


def test_the_direction_that_moved_is_forbidden_not_the_one_held_next() -> None:
    fixture = hit()
    for _ in range(10):
        fixture.tick()
        fixture.hold()
    fixture.hold(held=False)
    fixture.tick(2)
    assert fixture.hold(direction="forward") == ""
    fixture.pressed = False  # before anything moves forward
    fixture.decide()
    fixture.tick()
    fixture.pressed = True
    fixture.tick(2)
    assert fixture.state.release.forbidden == {"backward"}


def test_a_reset_and_a_new_contact_have_the_way_anew() -> None:
    fixture = hit()
    for _ in range(30):
        fixture.tick()
        fixture.hold()
    fixture.pressed = False
    fixture.tick()
    fixture.pressed = True
    fixture.tick(40)
    assert fixture.hold() == forbidden("backward")
    fixture.pressed = False
    fixture.tick(10)
    assert fixture.published().release is not None
    assert fixture.reset() == ""
    assert fixture.published().release is None
    fixture.pressed = True
    fixture.tick()
    release = fixture.published().release
    assert release is not None
    assert release.forbidden == ()
    assert release.left == pytest.approx(0.15 - 0.025 - 0.1**2 / 1.2)
    assert fixture.hold() == ""


def test_a_contact_after_an_hour_reports_the_age_and_nothing_moves_by_itself() -> None:
    fixture = PolicyFixture().running()
    fixture.drive(0.0, seconds=2)
    fixture.now_ns += 3600 * NS_PER_S
    fixture.tick(60)
    fixture.pressed = True
    fixture.tick(40)
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "backward"
    assert release.age is not None
    assert release.age > 3600
    assert fixture.hold(direction=None) == CHOOSE
    assert fixture.tick(10).command == "brake"
    assert fixture.hold(direction="forward") == ""
    assert fixture.tick(10).twist.linear > 0


def test_the_counters_end_the_way_when_wheels_slip() -> None:
    fixture = hit()
    began = fixture.distance
    while not fixture.hold():
        fixture.tick()
        fixture.distance -= 0.006  # three times the reported velocity
    assert fixture.hold() == USED_UP
    assert 0.1 < began - fixture.distance < 0.15


def test_a_release_ends_when_the_bumper_is_free() -> None:
    fixture = hit()
    fixture.hold()
    fixture.pressed = False
    assert fixture.tick().command == "brake"
    assert fixture.hold() == "The bumper is free: reset instead."
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


def test_a_new_press_has_no_way_anew() -> None:
    fixture = hit()
    while not fixture.hold():
        fixture.tick()
    fixture.tick(40)
    for clear in (2, 10):
        fixture.pressed = False
        fixture.tick(clear)
        fixture.pressed = True
        fixture.tick(40)
        for either in DIRECTIONS:
            assert fixture.hold(direction=either) == USED_UP


def test_a_press_long_after_a_release_forbids_nothing() -> None:
    fixture = hit()
    fixture.hold()
    fixture.tick(10)
    fixture.pressed = False
    fixture.tick(60)
    fixture.pressed = True
    fixture.tick()
    assert fixture.hold() == ""
    assert fixture.tick(5).command == "run"


def blink(fixture: PolicyFixture, field: str) -> None:
    """Report a fault of a motor driver once."""
    setattr(fixture, field, 1)
    fixture.tick()
    setattr(fixture, field, 0)


@pytest.mark.parametrize("cause", ["estop", "driver_left", "estop_reader", "flapping"])
def test_who_stands_on_the_bumper_gets_off_by_himself_whatever_else_was_latched(
    cause: str,
) -> None:
    fixture = hit()
    if cause == "estop":
        fixture.estop()
    elif cause == "driver_left":
        blink(fixture, "left_bits")
    elif cause == "estop_reader":
        fixture.estop_session_up = False
        fixture.tick()
        fixture.estop_session_up = True
    else:
        for _ in range(5):
            fixture.muted = {"velocity"}
            fixture.tick(12)
            fixture.muted = set()
            fixture.tick(30)
    fixture.tick(40)
    assert latched(fixture.state.latches) == ("contact", cause)
    assert fixture.hold() == f"{fixture.state.latches[cause].text} Reset first."
    assert fixture.reset() == ""
    assert fixture.verdict.reply is not None
    assert fixture.verdict.reply.text == f"Reset, but still latched: {HOLD}"
    assert latched(fixture.state.latches) == ("contact",)
    assert fixture.drive(0.5).command == "brake"
    assert fixture.drive(0.0).command == "brake"
    assert fixture.hold() == ""
    assert fixture.tick(2).twist.linear < 0
    fixture.pressed = False
    fixture.tick(10)
    assert fixture.reset() == ""
    assert fixture.drive().command == "run"


def test_a_reset_on_a_pressed_bumper_wants_all_that_a_reset_wants() -> None:
    fixture = hit()
    assert fixture.reset() == f"Still present: {HOLD}"
    fixture.estop()
    assert "Still present: The bumper was hit. Emergency stop." in fixture.reset()
    fixture.tick(3)
    fixture.linear = 0.3
    fixture.tick()
    assert fixture.reset() == "The vehicle still moves."
    fixture.linear = None
    fixture.tick()
    fixture.request(0.5)
    assert fixture.reset() == "Motion is requested: release the controls first."
    fixture.tick(40)
    fixture.pressed = False
    fixture.tick()
    assert fixture.reset() == "Still present: The bumper was hit."
    assert latched(fixture.state.latches) == ("contact", "estop")


def test_a_reset_on_a_pressed_bumper_leaves_what_is_not_gone() -> None:
    fixture = hit()
    fixture.estop()
    fixture.left_bits = 1
    fixture.tick(3)
    fault = fixture.state.latches["driver_left"].text
    assert fixture.reset() == ""
    assert fixture.verdict.reply is not None
    assert fixture.verdict.reply.text == f"Reset, but still latched: The bumper was hit. {fault}"
    assert latched(fixture.state.latches) == ("contact", "driver_left")
    fixture.tick()
    assert fixture.hold() == fault


def test_a_reset_lets_go_of_the_release() -> None:
    fixture = hit()
    assert fixture.hold() == ""
    fixture.estop()
    fixture.tick(3)
    assert fixture.reset() == ""
    assert fixture.verdict.command == "brake"
    assert fixture.tick(3).command == "brake"


def test_flapping_that_is_not_gone_is_not_forgiven() -> None:
    fixture = hit()
    fixture.state = replace(fixture.state, fault_budget=FaultBudget(0.0, fixture.now_ns))
    fixture.muted = {"velocity"}
    fixture.tick(12)
    fixture.muted = set()
    fixture.estop()
    fixture.tick(3)
    assert fixture.reset() == ""
    assert latched(fixture.state.latches) == ("contact", "flapping")
    assert fixture.state.fault_budget.is_spent


def test_pressed_from_the_start_no_way_is_believed_free_and_either_may_be_chosen() -> None:
    fixture = PolicyFixture()
    fixture.pressed = True
    fixture.tick(50)
    release = fixture.published().release
    assert release is not None
    assert (release.believed_free, release.travelled, release.age) == (None, 0.0, None)
    assert fixture.reset() == f"Still present: {HOLD}"
    assert fixture.hold(direction="forward") == ""
    assert fixture.tick(5).twist.linear > 0
    fixture.pressed = False
    fixture.tick(40)
    assert fixture.reset() == ""
    assert fixture.drive().command == "run"


def test_a_second_contact_looks_at_the_travel_between() -> None:
    fixture = hit()
    for _ in range(20):
        fixture.tick()
        fixture.hold()
    fixture.pressed = False
    fixture.tick(10)
    fixture.linear = -0.5  # pushed by hand
    fixture.tick(100)
    fixture.linear = None
    fixture.pressed = True
    fixture.tick(2)
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "forward"
    assert release.travelled == pytest.approx(-1.0)


@pytest.mark.parametrize("distance", [math.nan, math.inf])
def test_counters_that_are_no_numbers_stop_no_release_and_free_no_way(distance: float) -> None:
    fixture = hit()
    fixture.distance = distance
    fixture.muted = {"mileage"}
    fixture.put("mileage", Mileage(distance=distance, heading=0.0, epoch=0))
    while not fixture.hold():
        fixture.tick()
    assert fixture.hold() == USED_UP
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "backward"
    assert math.isfinite(release.travelled)
