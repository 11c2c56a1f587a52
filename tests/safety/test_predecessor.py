"""A latch outlives the service that holds it: the bridge remembers it, the next one takes it on."""

import pytest
from msgspec.structs import replace
from msgspec.structs import replace as with_fields

from common.messages import Direction
from services.safety.latches import latched
from services.safety.report import motion_message
from tests.safety.policy_fixture import Scene

OLD, OWN = 5, 6
DIRECTIONS: tuple[Direction, ...] = ("forward", "backward")
UNKNOWN = (
    "Safety has restarted: the travel of an earlier release is unknown. Push the vehicle off by "
    "hand, then reset."
)


def successor(latched_by: int | None) -> Scene:
    """Start a service beside a bridge that remembers this."""
    scene = Scene()
    scene.inputs = replace(scene.inputs, boot=OWN)
    scene.link = with_fields(scene.link, latched_by=latched_by)
    return scene


def test_a_latch_is_told_until_it_is_reset() -> None:
    scene = Scene().running()
    assert not motion_message(scene.state, scene.inputs).latched
    scene.estop()
    assert motion_message(scene.state, scene.inputs).latched
    scene.drive(0.0, seconds=1.0)
    assert scene.reset() == ""
    assert not motion_message(scene.state, scene.inputs).latched


def test_a_successor_takes_the_latch_on_and_only_a_reset_clears_it() -> None:
    scene = successor(latched_by=OLD)
    scene.tick(100)
    scene.drive(0.0)
    assert scene.drive(0.5, seconds=1.0).command == "brake"
    assert latched(scene.state.latches) == ("predecessor",)
    motion = motion_message(scene.state, scene.inputs)
    assert (motion.latched, motion.predecessor) == (True, OLD)
    assert scene.reset() == "Not gone yet: Safety started anew with a reset still due."
    scene.link = with_fields(scene.link, latched_by=OWN)  # the bridge has heard of it from us
    scene.tick(100)
    assert scene.reset() == ""
    scene.link = with_fields(scene.link, latched_by=None)
    scene.drive(0.0)
    assert scene.drive(0.5).command == "run"


def test_a_motion_that_the_bridge_braked_alone_has_its_own_text() -> None:
    scene = successor(latched_by=OLD)
    scene.tick(10)
    bridge = scene.inputs.link
    assert bridge is not None
    scene.link = with_fields(scene.link, latched_by=bridge.value.boot)
    scene.tick(10)
    assert scene.state.latches["predecessor"].text == (
        "The vehicle moved without a command while safety was absent."
    )


def test_a_successor_that_has_heard_nothing_names_no_predecessor() -> None:
    scene = successor(latched_by=OLD)
    scene.muted = {"link"}
    scene.tick()
    scene.estop()
    motion = motion_message(scene.state, scene.inputs)
    assert (motion.latched, motion.predecessor) == (True, None)


def test_without_a_latch_a_successor_needs_no_reset() -> None:
    successor(latched_by=None).ready()


@pytest.mark.parametrize("first", ["bumper", "link"])
def test_a_successor_gives_no_release_for_a_contact_beside_the_latch(first: str) -> None:
    scene = successor(latched_by=OLD)
    scene.pressed = True
    scene.muted = {"link" if first == "bumper" else "bumper"}
    scene.tick(3)
    scene.muted = set()
    scene.tick(50)
    assert latched(scene.state.latches) == ("contact", "predecessor")
    scene.link = with_fields(scene.link, latched_by=OWN)
    scene.tick(10)
    assert scene.reset() == ""
    assert scene.verdict.reply is not None
    assert scene.verdict.reply.text == f"Reset all but this: The bumper was hit. {UNKNOWN}"
    scene.tick()
    for direction in DIRECTIONS:
        assert scene.hold(direction=direction) == UNKNOWN
    told = scene.tell().release
    assert told is not None
    assert told.left == 0.0
    assert scene.reset() == f"Not gone yet: The bumper was hit. {UNKNOWN}"


def test_the_next_contact_after_a_reset_has_a_release_again() -> None:
    scene = successor(latched_by=OLD)
    scene.pressed = True
    scene.tick(50)
    scene.link = with_fields(scene.link, latched_by=OWN)
    scene.pressed = False
    scene.tick(10)
    assert scene.reset() == ""
    assert latched(scene.state.latches) == ()
    scene.pressed = True
    scene.tick(5)
    assert scene.hold() == ""
    assert scene.tick(3).command == "run"
