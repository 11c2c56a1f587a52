"""A latch that outlives its safety service: who may move the vehicle, and who takes it on."""

import pytest
from msgspec.structs import replace
from msgspec.structs import replace as replace_message

from common.messages import Motion
from common.motion import Command
from services.bridge.lease import Lease, Refusal
from tests.bridge.motions import ARMED, LEASE, NOW, OWED, brake, obey, run, stop, taking_on


@pytest.mark.parametrize(
    ("state", "motion", "order", "refusal"),
    [
        # its own authority may creep, another must take it on
        (replace(ARMED, latched_by=1), run(), Command.RUN, None),
        (OWED, run(), Command.STOP, Refusal.NOT_LATCH_OWNER),
        (OWED, run(0.0), Command.STOP, Refusal.NOT_LATCH_OWNER),
        (OWED, stop(), Command.STOP, None),
        (OWED, brake(), Command.BRAKE, None),
        (OWED, taking_on(run(), 3), Command.RUN, None),
        (OWED, taking_on(run(), None), Command.STOP, Refusal.NOT_LATCH_OWNER),
        (OWED, taking_on(run(), 4), Command.STOP, Refusal.NOT_LATCH_OWNER),
    ],
)
def test_order(state: Lease, motion: Motion, order: Command, refusal: Refusal | None) -> None:
    assert obey(state, motion)[1:] == (order, refusal)


def test_a_latch_is_remembered_until_it_is_reset_by_who_holds_it() -> None:
    latched, _, _ = obey(ARMED, replace_message(brake(), latched=True))
    assert latched.latched_by == 1
    later = NOW + LEASE + 1
    started, _, _ = obey(latched, stop(1, boot=2), later)  # has not received the latch yet
    assert (started.boot, started.latched_by) == (2, 1)
    other, _, _ = obey(started, taking_on(brake(2, boot=2), None), later)  # for its own reason
    assert other.latched_by == 1
    free, _, _ = obey(other, replace_message(stop(3, boot=2), predecessor=1), later)
    assert free.latched_by == 1
    taken, _, _ = obey(other, taking_on(brake(3, boot=2), 1), later)
    assert taken.latched_by == 2
    again, _, _ = obey(
        taken, taking_on(brake(4, boot=2), 1), later
    )  # has not received its own latch yet
    assert again.latched_by == 2
    reset, _, _ = obey(again, stop(5, boot=2), later)
    assert reset.latched_by is None


def test_the_latch_of_a_second_authority_is_not_taken_in() -> None:
    lease, _, refusal = obey(ARMED, replace_message(brake(boot=2), latched=True))
    assert (lease.latched_by, refusal) == (None, Refusal.SECOND_AUTHORITY)
