"""Moving off a pressed bumper, through the whole decision."""

import math

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import Direction, Mileage
from services.safety.causes import BY_NAME
from services.safety.fault_budget import FaultBudget
from services.safety.inputs import Hold
from services.safety.latches import latched
from services.safety.state import Reply
from tests.safety.policy_fixture import NO_ECHO_TEXT, Scene, hit, link

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
    scene, began = hit(), hit().distance
    for _ in range(300):
        scene.tick()
        if scene.hold(direction=direction):
            break
        if scene.verdict.command == "run":
            assert 0 <= sign * scene.verdict.twist.linear <= 0.1 + 1e-9
            assert scene.verdict.twist.angular == 0
            assert scene.verdict.source == "release"
    scene.tick(40)
    assert 0.1 < sign * (scene.distance - began) <= 0.15
    for either in DIRECTIONS:
        assert scene.hold(direction=either) == USED_UP
    assert scene.tick().command == "brake"
    assert "contact" in latched(scene.state.latches)


def test_the_operator_has_to_choose_a_direction() -> None:
    scene = hit()
    assert scene.hold(direction=None) == CHOOSE
    assert scene.tick(3).command == "brake"
    assert scene.hold() == ""
    assert scene.tick(3).command == "run"
    assert scene.hold(direction=None) == CHOOSE
    assert scene.verdict.command == "brake"  # a wrong call ends it


def test_a_release_that_is_let_go_ends() -> None:
    scene = hit()
    assert scene.hold() == ""
    assert scene.tick(5).command == "run"
    assert scene.hold(held=False) == ""
    assert scene.verdict.command == "brake"
    assert scene.hold() == LET_GO  # it echoes no newer state than the call that let go
    scene.linear = -0.05
    scene.tick()
    assert scene.hold() == "The vehicle still moves."
    scene.linear = None
    scene.tick()
    assert scene.hold() == ""
    assert scene.tick(10).command == "run"
    assert scene.tick(6).command == "brake"  # not repeated within its lease


def test_calls_that_were_overtaken_by_the_one_that_let_go_do_not_hold_again() -> None:
    scene = hit()
    scene.hold()
    scene.tick(3)
    early = scene.echo
    scene.tick(3)
    scene.hold(held=False)
    scene.tick(10)
    for echo in (early, early + 3):
        assert scene.hold(echo=echo) == LET_GO
        assert scene.verdict.command == "brake"
    assert scene.hold(echo=early + 4) == ""


@pytest.mark.parametrize("echo", [None, 2**62, -5])
def test_whoever_lets_go_is_obeyed_and_later_calls_count_again(echo: int | None) -> None:
    scene = hit()
    assert scene.hold() == ""
    assert scene.tick(5).command == "run"
    assert scene.decide(Hold(False, None, echo)).command == "brake"
    scene.tick()
    assert scene.hold() == ""
    assert scene.tick(5).command == "run"


def test_a_change_of_direction_begins_at_rest() -> None:
    scene = hit()
    scene.linear = 0.0  # held by what it hit: measured, it stands all the time
    scene.hold()
    assert scene.tick(10).twist.linear < 0
    assert scene.hold(direction="forward") == OTHER
    assert scene.verdict.command == "brake"
    scene.tick()
    assert scene.hold(direction="forward") == ""
    for _ in range(10):
        assert scene.verdict.twist.linear >= 0
        scene.tick()
    assert scene.verdict.twist.linear > 0
    scene.linear = 0.05
    assert scene.tick(20).command == "brake"
    assert scene.hold(direction="backward") == "The vehicle still moves."


def test_late_calls_move_nothing_and_change_nothing() -> None:
    scene = hit()
    old = scene.echo
    scene.tick(100)
    for number in range(20):
        assert scene.hold(echo=old + number).startswith("The call is ")
        assert scene.verdict.command == "brake"
    assert scene.hold(echo=-7).startswith("The call echoes an unknown heartbeat")
    assert scene.decide(Hold(True, "backward")).reply == Reply(False, NO_ECHO_TEXT)
    assert scene.hold() == ""
    assert scene.tick(3).command == "run"
    assert scene.hold(echo=old) != ""
    assert scene.verdict.command == "run"  # a hold that is granted continues


@pytest.mark.parametrize(("ticks", "allowed"), [(20, True), (21, False)])
def test_a_hold_is_no_older_than_a_request(ticks: int, allowed: bool) -> None:
    scene = hit()
    old = scene.echo
    scene.tick(ticks)
    assert (scene.hold(echo=old) == "") == allowed


def test_a_rebound_before_the_bumper_does_not_choose_the_direction() -> None:
    scene = Scene().running()
    scene.linear = -0.05
    scene.tick(2)
    scene.pressed = True
    scene.tick()
    scene.linear = 0.0
    scene.tick(40)
    scene.linear = None
    told = scene.tell().release
    assert told is not None
    assert told.believed_free == "backward"
    assert told.travelled == pytest.approx(0.75, abs=0.03)
    assert told.age == pytest.approx(0.86, abs=0.05)
    scene.hold()
    assert scene.tick(10).twist.linear < 0


def test_pressed_again_while_it_moves_off_it_goes_no_farther_that_way() -> None:
    scene, runs = hit(), 0
    for _ in range(30):
        scene.tick()
        assert scene.hold() == ""
    scene.pressed = False
    scene.tick(5)
    scene.pressed = True
    for _ in range(300):
        runs += scene.tick().command == "run"
        assert scene.hold() == forbidden("backward")
    assert runs == 0
    told = scene.tell().release
    assert told is not None
    assert (told.believed_free, told.forbidden) == (None, ("backward",))
    left = told.left
    assert scene.hold(direction="forward") == ""
    assert scene.tick(5).twist.linear > 0
    told = scene.tell().release
    assert told is not None
    assert 0 < told.left < left < 0.1
    scene.pressed = False
    scene.tick()
    scene.pressed = True
    scene.tick(40)
    for either in DIRECTIONS:
        assert scene.hold(direction=either) == BOTH
    assert scene.reset() == f"Not gone yet: {BY_NAME['contact'].text} {BOTH}"


def press_again(scene: Scene, direction: Direction) -> None:
    """Let the bumper be free for a moment while it moves off this way."""
    for _ in range(10):
        scene.tick()
        scene.hold(direction=direction)
    scene.pressed = False
    scene.tick()
    scene.pressed = True
    scene.tick(40)


@pytest.mark.parametrize(
    ("pressed_again", "advice"),
    [
        (
            "backward",
            "Hold release forward to move off. The vehicle came forward to the contact: check that "
            "way first.",
        ),
        ("forward", "Hold release backward to move off."),
    ],
)
def test_the_advice_names_only_the_direction_that_is_left(
    pressed_again: Direction, advice: str
) -> None:
    scene = hit()
    press_again(scene, pressed_again)
    assert scene.reset() == f"Not gone yet: The bumper was hit. {advice}"


def test_the_direction_that_moved_is_forbidden_not_the_one_held_next() -> None:
    scene = hit()
    for _ in range(10):
        scene.tick()
        scene.hold()
    scene.hold(held=False)
    scene.tick(2)
    assert scene.hold(direction="forward") == ""
    scene.pressed = False  # before anything moves forward
    scene.decide()
    scene.tick()
    scene.pressed = True
    scene.tick(2)
    assert scene.state.release.forbidden == {"backward"}


def test_a_reset_and_a_new_contact_have_the_way_anew() -> None:
    scene = hit()
    for _ in range(30):
        scene.tick()
        scene.hold()
    scene.pressed = False
    scene.tick()
    scene.pressed = True
    scene.tick(40)
    assert scene.hold() == forbidden("backward")
    scene.pressed = False
    scene.tick(10)
    assert scene.tell().release is not None
    assert scene.reset() == ""
    assert scene.tell().release is None
    scene.pressed = True
    scene.tick()
    told = scene.tell().release
    assert told is not None
    assert told.forbidden == ()
    assert told.left == pytest.approx(0.15 - 0.025 - 0.1**2 / 1.2)
    assert scene.hold() == ""


def test_touched_after_an_hour_the_age_is_told_and_nothing_moves_by_itself() -> None:
    scene = Scene().running()
    scene.drive(0.0, seconds=2)
    scene.now_ns += 3600 * NS_PER_S
    scene.tick(60)
    scene.pressed = True
    scene.tick(40)
    told = scene.tell().release
    assert told is not None
    assert told.believed_free == "backward"
    assert told.age is not None
    assert told.age > 3600
    assert scene.hold(direction=None) == CHOOSE
    assert scene.tick(10).command == "brake"
    assert scene.hold(direction="forward") == ""
    assert scene.tick(10).twist.linear > 0


def test_the_counters_end_the_way_when_wheels_slip() -> None:
    scene = hit()
    began = scene.distance
    while not scene.hold():
        scene.tick()
        scene.distance -= 0.006  # three times as fast as the velocity says
    assert scene.hold() == USED_UP
    assert 0.1 < began - scene.distance < 0.15


def test_a_release_ends_when_the_bumper_is_free() -> None:
    scene = hit()
    scene.hold()
    scene.pressed = False
    assert scene.tick().command == "brake"
    assert scene.hold() == "The bumper is free: reset instead."
    scene.hold(held=False)
    scene.pressed = True
    assert scene.tick(5).command == "brake"


def test_a_release_does_not_go_on_when_the_bumper_is_pressed_anew() -> None:
    scene = hit()
    scene.hold()
    scene.tick()
    scene.pressed = False
    scene.tick()
    scene.pressed = True
    assert scene.tick().command == "brake"  # within the lease of the call
    assert scene.tick(3).command == "brake"


def test_a_release_goes_nowhere_without_its_conditions() -> None:
    assert Scene().ready().hold() == "There is no contact to release."
    scene = hit()
    scene.estop()
    assert scene.hold() == "Emergency stop."
    scene.tick(3)
    assert scene.hold() == "Emergency stop. Reset first."
    scene = hit()
    scene.link = link("lost")
    scene.tick()
    assert scene.hold() == "The link to the board is lost."
    scene = hit()
    scene.linear = 0.3
    scene.tick()
    assert scene.hold() == "The vehicle still moves."


def test_a_release_wants_a_velocity_that_is_young() -> None:
    scene = hit()
    scene.muted = {"velocity"}
    scene.tick(11)
    assert scene.hold() == "Not heard lately: velocity."


def test_a_release_obeys_the_sonars() -> None:
    scene = hit()
    scene.sonar(rear=0.1)
    scene.tick()
    assert scene.hold() == ""
    assert scene.tick(3).command == "stop"
    assert "blocked" in scene.state.latches


def test_a_release_that_a_faulty_sonar_blocks_gives_no_advice_for_sources() -> None:
    scene = hit()
    scene.sonar(rear=None)
    scene.tick()
    assert scene.hold() == ""
    assert scene.tick(3).command == "stop"
    text = scene.state.latches["blocked"].text
    assert text == "No motion toward the rear: that sonar is faulty."


def test_a_release_is_refused_while_two_publishers_bar_motion() -> None:
    scene = hit()
    for boot in (1, 2):
        scene.driver_boot = boot
        scene.ask()
    assert scene.hold() == "Two publishers ask on teleop."
    assert scene.tick(3).command == "brake"
    scene.tick(40)
    assert scene.hold() == ""
    for boot in (3, 4):  # a release that is held ends, too
        scene.driver_boot = boot
        scene.ask()
    assert scene.hold() == "Two publishers ask on teleop."
    assert scene.verdict.command == "brake"


def test_a_new_press_has_no_way_anew() -> None:
    scene = hit()
    while not scene.hold():
        scene.tick()
    scene.tick(40)
    for clear in (2, 10):
        scene.pressed = False
        scene.tick(clear)
        scene.pressed = True
        scene.tick(40)
        for either in DIRECTIONS:
            assert scene.hold(direction=either) == USED_UP


def test_a_press_long_after_a_release_forbids_nothing() -> None:
    scene = hit()
    scene.hold()
    scene.tick(10)
    scene.pressed = False
    scene.tick(60)
    scene.pressed = True
    scene.tick()
    assert scene.hold() == ""
    assert scene.tick(5).command == "run"


def blink(scene: Scene, field: str) -> None:
    """Let a motor driver report a fault once."""
    setattr(scene, field, 1)
    scene.tick()
    setattr(scene, field, 0)


@pytest.mark.parametrize("cause", ["estop", "driver_left", "estop_reader", "flapping"])
def test_who_stands_on_the_bumper_gets_off_by_himself_whatever_else_was_latched(
    cause: str,
) -> None:
    scene = hit()
    if cause == "estop":
        scene.estop()
    elif cause == "driver_left":
        blink(scene, "left_bits")
    elif cause == "estop_reader":
        scene.reader = False
        scene.tick()
        scene.reader = True
    else:
        for _ in range(5):
            scene.muted = {"velocity"}
            scene.tick(12)
            scene.muted = set()
            scene.tick(30)
    scene.tick(40)
    assert latched(scene.state.latches) == ("contact", cause)
    assert scene.hold() == f"{scene.state.latches[cause].text} Reset first."
    assert scene.reset() == ""
    assert scene.verdict.reply is not None
    assert scene.verdict.reply.text == f"Reset all but this: {HOLD}"
    assert latched(scene.state.latches) == ("contact",)
    assert scene.drive(0.5).command == "brake"
    assert scene.drive(0.0).command == "brake"
    assert scene.hold() == ""
    assert scene.tick(2).twist.linear < 0
    scene.pressed = False
    scene.tick(10)
    assert scene.reset() == ""
    assert scene.drive().command == "run"


def test_a_reset_on_a_pressed_bumper_wants_all_that_a_reset_wants() -> None:
    scene = hit()
    assert scene.reset() == f"Not gone yet: {HOLD}"
    scene.estop()
    assert "Not gone yet: The bumper was hit. Emergency stop." in scene.reset()
    scene.tick(3)
    scene.linear = 0.3
    scene.tick()
    assert scene.reset() == "The vehicle still moves."
    scene.linear = None
    scene.tick()
    scene.ask(0.5)
    assert scene.reset() == "Motion is requested: release the controls first."
    scene.tick(40)
    scene.pressed = False
    scene.tick()
    assert scene.reset() == "Not gone yet: The bumper was hit."
    assert latched(scene.state.latches) == ("contact", "estop")


def test_a_reset_on_a_pressed_bumper_leaves_what_is_not_gone() -> None:
    scene = hit()
    scene.estop()
    scene.left_bits = 1
    scene.tick(3)
    fault = scene.state.latches["driver_left"].text
    assert scene.reset() == ""
    assert scene.verdict.reply is not None
    assert scene.verdict.reply.text == f"Reset all but this: The bumper was hit. {fault}"
    assert latched(scene.state.latches) == ("contact", "driver_left")
    scene.tick()
    assert scene.hold() == fault


def test_a_reset_lets_go_of_the_release() -> None:
    scene = hit()
    assert scene.hold() == ""
    scene.estop()
    scene.tick(3)
    assert scene.reset() == ""
    assert scene.verdict.command == "brake"
    assert scene.tick(3).command == "brake"


def test_flapping_that_is_not_gone_is_not_forgiven() -> None:
    scene = hit()
    scene.state = replace(scene.state, credit=FaultBudget(0.0, scene.now_ns))
    scene.muted = {"velocity"}
    scene.tick(12)
    scene.muted = set()
    scene.estop()
    scene.tick(3)
    assert scene.reset() == ""
    assert latched(scene.state.latches) == ("contact", "flapping")
    assert scene.state.credit.is_spent


def test_pressed_from_the_start_no_way_is_believed_free_and_either_may_be_chosen() -> None:
    scene = Scene()
    scene.pressed = True
    scene.tick(50)
    told = scene.tell().release
    assert told is not None
    assert (told.believed_free, told.travelled, told.age) == (None, 0.0, None)
    assert scene.reset() == f"Not gone yet: {HOLD}"
    assert scene.hold(direction="forward") == ""
    assert scene.tick(5).twist.linear > 0
    scene.pressed = False
    scene.tick(40)
    assert scene.reset() == ""
    assert scene.drive().command == "run"


def test_a_second_contact_looks_at_the_travel_between() -> None:
    scene = hit()
    for _ in range(20):
        scene.tick()
        scene.hold()
    scene.pressed = False
    scene.tick(10)
    scene.linear = -0.5  # pushed by hand
    scene.tick(100)
    scene.linear = None
    scene.pressed = True
    scene.tick(2)
    told = scene.tell().release
    assert told is not None
    assert told.believed_free == "forward"
    assert told.travelled == pytest.approx(-1.0)


@pytest.mark.parametrize("distance", [math.nan, math.inf])
def test_counters_that_are_no_numbers_stop_no_release_and_free_no_way(distance: float) -> None:
    scene = hit()
    scene.distance = distance
    scene.muted = {"mileage"}
    scene.put("mileage", Mileage(distance=distance, heading=0.0, epoch=0))
    while not scene.hold():
        scene.tick()
    assert scene.hold() == USED_UP
    told = scene.tell().release
    assert told is not None
    assert told.believed_free == "backward"
    assert math.isfinite(told.travelled)
