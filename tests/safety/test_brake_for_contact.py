"""BRAKE for a new contact before the decision, equal to the decision's own motion."""

import pytest
from msgspec.structs import replace

from common.freshness import Latest
from common.messages import Bumper
from services.safety.core.inputs import Inputs
from tests.safety.policy_fixture import PolicyFixture, hit, link


@pytest.mark.parametrize("latched_by", [None, 41])
def test_a_new_contact_brakes_first_as_its_decision_does(latched_by: int | None) -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.link = replace(link(), latched_by=latched_by)
    fixture.pressed = True
    fixture.tick()
    first, decided = fixture.motions
    assert first == replace(decided, source=None)  # the first BRAKE answers no source
    assert (first.command, first.judged, first.latched) == ("brake", fixture.seq, True)
    assert first.predecessor == latched_by


def test_other_samples_yield_one_motion() -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.tick()
    assert len(fixture.motions) == 1
    fixture = hit()  # a release may be moving the vehicle off the obstacle
    fixture.tick()
    assert len(fixture.motions) == 1


def test_a_contact_brakes_before_any_other_sample() -> None:
    fixture = PolicyFixture()
    fixture.inputs = Inputs(bumper=Latest(Bumper(pressed=True), 5))
    fixture.decide()
    assert [motion.command for motion in fixture.motions] == ["brake", "brake"]
    assert fixture.motions[0].predecessor is None
