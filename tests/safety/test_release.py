"""Creeping off a pressed bumper, through the whole decision."""

from services.safety.latches import latched
from tests.safety.scene import TICK_S, Scene, hit


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
    scene = Scene()
    scene.pressed = True
    scene.tick(50)
    assert "not known which way" in scene.hold()
    scene = hit()
    scene.linear = 0.3
    scene.tick()
    assert scene.hold() == "The vehicle still moves."


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
