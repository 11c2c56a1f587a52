"""A latch outlives the service that holds it: the bridge remembers it, the next one takes it on."""

import pytest
from msgspec.structs import replace
from msgspec.structs import replace as with_fields

from common.messages import Direction
from services.safety.core.causes import latched
from tests.safety.policy_fixture import PolicyFixture

OLD, OWN = 5, 6
DIRECTIONS: tuple[Direction, ...] = ("forward", "backward")
UNKNOWN = (
    "Safety has restarted: the travel of an earlier release is unknown. Push the vehicle off by "
    "hand, then reset."
)


def successor(latched_by: int | None) -> PolicyFixture:
    """Start a service beside a bridge that remembers this."""
    fixture = PolicyFixture()
    fixture.inputs = replace(fixture.inputs, boot=OWN)
    fixture.link = with_fields(fixture.link, latched_by=latched_by)
    return fixture


def test_a_latch_is_reported_until_it_is_reset() -> None:
    fixture, told = PolicyFixture().running(), []
    for step in (fixture.tick, fixture.estop, lambda: fixture.drive(0.0, seconds=1.0)):
        step()
        told.append(fixture.motions[-1].latched)
    assert fixture.reset() == ""
    assert [*told, fixture.motions[-1].latched] == [False, True, True, False]


def test_a_successor_takes_the_latch_on_and_only_a_reset_clears_it() -> None:
    fixture = successor(latched_by=OLD)
    fixture.tick(100)
    fixture.drive(0.0)
    assert fixture.drive(0.5, seconds=1.0).command == "brake"
    assert latched(fixture.state.latches) == ("predecessor",)
    motion = fixture.motions[-1]
    assert (motion.latched, motion.predecessor) == (True, OLD)
    assert fixture.reset() == "Still present: Safety restarted while a reset was due."
    fixture.link = with_fields(fixture.link, latched_by=OWN)  # the bridge has received our latch
    fixture.tick(100)
    assert fixture.reset() == ""
    fixture.link = with_fields(fixture.link, latched_by=None)
    fixture.drive(0.0)
    assert fixture.drive(0.5).command == "run"


def test_a_motion_that_the_bridge_braked_alone_has_its_own_text() -> None:
    fixture = successor(latched_by=OLD)
    fixture.tick(10)
    bridge = fixture.inputs.link
    assert bridge is not None
    fixture.link = with_fields(fixture.link, latched_by=bridge.value.boot)
    fixture.tick(10)
    assert fixture.state.latches["predecessor"].text == (
        "The vehicle moved without a command while safety was absent."
    )


def test_a_successor_without_a_link_sample_names_no_predecessor() -> None:
    fixture = successor(latched_by=OLD)
    fixture.muted = {"link"}
    fixture.tick()
    fixture.estop()
    motion = fixture.motions[-1]
    assert (motion.latched, motion.predecessor) == (True, None)


def test_without_a_latch_a_successor_needs_no_reset() -> None:
    successor(latched_by=None).ready()


@pytest.mark.parametrize("first", ["bumper", "link"])
def test_a_successor_gives_no_release_for_a_contact_beside_the_latch(first: str) -> None:
    fixture = successor(latched_by=OLD)
    fixture.pressed = True
    fixture.muted = {"link" if first == "bumper" else "bumper"}
    fixture.tick(3)
    fixture.muted = set()
    fixture.tick(50)
    assert latched(fixture.state.latches) == ("contact", "predecessor")
    fixture.link = with_fields(fixture.link, latched_by=OWN)
    fixture.tick(10)
    assert fixture.reset() == ""
    assert fixture.verdict.reply is not None
    assert fixture.verdict.reply.text == f"Reset, but still latched: The bumper was hit. {UNKNOWN}"
    for direction in DIRECTIONS:
        fixture.let_go()
        assert fixture.hold(direction) == UNKNOWN
    fixture.let_go()
    release = fixture.published().release
    assert release is not None
    assert release.left == 0.0
    assert fixture.reset() == f"Still present: The bumper was hit. {UNKNOWN}"


def test_the_next_contact_after_a_reset_has_a_release_again() -> None:
    fixture = successor(latched_by=OLD)
    fixture.pressed = True
    fixture.tick(50)
    fixture.link = with_fields(fixture.link, latched_by=OWN)
    fixture.pressed = False
    fixture.tick(10)
    assert fixture.reset() == ""
    assert latched(fixture.state.latches) == ()
    fixture.pressed = True
    fixture.let_go(5)
    assert fixture.hold() == ""
    assert fixture.tick(3).command == "run"
