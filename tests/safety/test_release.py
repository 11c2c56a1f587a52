"""Creeping off a pressed bumper, through the whole decision."""

import pytest
from msgspec.structs import replace

from services.safety.causes import BY_NAME
from services.safety.flapping import Credit
from services.safety.latches import latched
from tests.safety.scene import TICK_S, Scene, hit, link

HOLD = "The bumper was hit. Hold release to creep off."
NO_WAY = (
    "It is not known which way leads off, because no motion was measured before the bumper was "
    "pressed. Push the vehicle off by hand, then reset."
)


def test_a_held_release_creeps_back_and_no_farther_than_its_way() -> None:
    scene, travelled = hit(), 0.0
    for _ in range(300):
        scene.tick()
        if scene.hold():
            break
        if scene.verdict.command == "run":
            assert -0.1 - 1e-9 <= scene.verdict.twist.linear <= 0
            assert scene.verdict.source == "release"
            travelled -= scene.verdict.twist.linear * TICK_S
    assert 0.1 < travelled <= 0.15
    assert "used up" in scene.hold()
    assert scene.tick().command == "brake"
    assert "contact" in latched(scene.state.latches)


def test_a_release_that_is_let_go_ends() -> None:
    scene = hit()
    assert scene.hold() == ""
    assert scene.tick(5).command == "run"
    assert scene.hold(held=False) == ""
    assert scene.verdict.command == "brake"
    assert scene.hold() == "The vehicle still moves."
    scene.tick()
    assert scene.hold() == ""
    assert scene.tick(10).command == "run"
    assert scene.tick(6).command == "brake"  # not repeated within its lease


def test_a_release_ends_when_the_bumper_is_free() -> None:
    scene = hit()
    scene.hold()
    scene.pressed = False
    assert scene.tick().command == "brake"
    assert scene.hold() == "The bumper is free: reset instead."


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


def test_a_new_press_has_its_way_anew_and_the_old_one_has_not() -> None:
    scene = hit()
    while not scene.hold():
        scene.tick()
    scene.pressed = False
    scene.tick(2)
    scene.pressed = True
    scene.tick(40)
    assert "used up" in scene.hold()
    scene.pressed = False
    scene.tick(3)
    scene.pressed = True
    scene.tick()
    assert scene.hold() == ""
    scene.tick(5)
    assert scene.verdict.twist.linear > 0  # it came to this press backwards


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
    scene.state = replace(scene.state, credit=Credit(0.0, scene.now_ns))
    scene.muted = {"velocity"}
    scene.tick(12)
    scene.muted = set()
    scene.estop()
    scene.tick(3)
    assert scene.reset() == ""
    assert latched(scene.state.latches) == ("contact", "flapping")
    assert scene.state.credit.is_spent


def test_pressed_from_the_start_there_is_no_way_off() -> None:
    scene = Scene()
    scene.pressed = True
    scene.tick(50)
    assert scene.hold() == NO_WAY
    assert scene.reset() == f"Not gone yet: {BY_NAME['contact'].text} {NO_WAY}"
    scene.linear = -0.2  # pushed while it is still pressed: that tells nothing either
    scene.tick()
    scene.linear = None
    scene.tick()
    assert scene.hold() == NO_WAY
    scene.pressed = False
    scene.tick(3)
    assert scene.reset() == ""
    assert scene.drive().command == "run"
