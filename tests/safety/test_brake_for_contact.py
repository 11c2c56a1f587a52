"""BRAKE for a contact before the decision, equal to the decision's own motion."""

import pytest
from msgspec.structs import replace

from common.freshness import Latest
from common.messages import Bumper, Motion
from services.safety.inputs import Inputs
from services.safety.policy import brake_for_contact
from services.safety.report import motion_message
from tests.safety.policy_fixture import PolicyFixture, hit, link


def feed(fixture: PolicyFixture, *, pressed: bool) -> Motion | None:
    """Feed the samples of the next tick without a decision; return the BRAKE."""
    fixture.pressed = pressed
    fixture.feed()
    return brake_for_contact(fixture.state, fixture.inputs)


@pytest.mark.parametrize("latched_by", [None, 41])
def test_a_new_contact_brakes_as_its_decision_does(latched_by: int | None) -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.link = replace(link(), latched_by=latched_by)
    first = feed(fixture, pressed=True)
    fixture.decide()
    decided = motion_message(fixture.state, fixture.inputs)
    assert first == replace(decided, source=None)  # the first BRAKE answers no source
    assert first is not None
    assert (first.command, first.judged, first.latched) == ("brake", fixture.seq, True)


def test_clear_samples_need_a_decision() -> None:
    assert feed(PolicyFixture().running(0.3), pressed=False) is None


def test_a_contact_that_is_held_needs_a_decision() -> None:
    # A release may be moving the vehicle off the obstacle.
    assert feed(hit(), pressed=True) is None


def test_without_link_and_bumper_there_is_no_predecessor_and_no_brake() -> None:
    fixture = PolicyFixture()
    assert brake_for_contact(fixture.state, Inputs()) is None
    brake = brake_for_contact(fixture.state, Inputs(bumper=Latest(Bumper(pressed=True), 5)))
    assert brake is not None
    assert brake.predecessor is None
