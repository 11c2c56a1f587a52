"""The end of a lease: late motions, STOP, BRAKE, and when they are sent."""

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import Motion
from common.motion import Command
from services.bridge.lease import Lease, Refusal, on_motion, on_ready, on_tick
from tests.bridge.motions import (
    ARMED,
    COAST,
    HIT,
    LEASE,
    MOVED,
    MS,
    NOW,
    OWN_BOOT,
    brake,
    obey,
    run,
    stop,
)


def test_at_once_is_at_once_even_when_the_clock_has_just_begun() -> None:
    lost = on_ready(replace(ARMED, renewed_ns=0), False)
    assert on_tick(lost, 0, LEASE, COAST, True)[1] is Command.STOP


def late(lease: Lease, motion: Motion, waited: int) -> tuple[Lease, Command | None, object]:
    """Handle a motion so long after it was received."""
    now = NOW + waited
    return on_motion(lease, motion, now, LEASE, OWN_BOOT, received_ns=NOW)


@pytest.mark.parametrize("waited", [0, LEASE])
def test_the_lease_counts_from_when_a_motion_was_received(waited: int) -> None:
    state = replace(ARMED, renewed_ns=NOW + waited)
    after, order, refusal = late(state, run(), waited)
    assert (order, refusal) == (Command.RUN, None)
    assert (after.renewed_ns, after.sent_ns) == (NOW, NOW + waited)
    assert on_tick(after, NOW + LEASE, LEASE, COAST, True)[1] is None
    assert on_tick(after, NOW + LEASE + 1, LEASE, COAST, True)[1] is Command.STOP


@pytest.mark.parametrize(
    ("motion", "order"), [(run(), None), (run(0.0), None), (stop(), None), (brake(), Command.BRAKE)]
)
def test_what_waited_for_longer_than_the_lease_renews_nothing(
    motion: Motion, order: Command | None
) -> None:
    state = replace(ARMED, renewed_ns=NOW + LEASE, neutral=False)
    after = replace(state, braked=order is Command.BRAKE)
    assert late(state, motion, LEASE + 1) == (after, order, Refusal.LATE)


@pytest.mark.parametrize("waited", [0, LEASE + 1])
def test_a_brake_goes_on_when_the_lease_ends(waited: int) -> None:
    state, order, _ = late(ARMED, brake(), waited)
    assert (order, state.braked) == (Command.BRAKE, True)
    now = NOW + LEASE + 1
    over, order = on_tick(state, now, LEASE, COAST, True)
    assert order is Command.BRAKE
    assert on_tick(over, now + 3600 * NS_PER_S, LEASE, COAST, True)[1] is Command.BRAKE


@pytest.mark.parametrize("motion", [stop(12), run(seq=12), run(0.0, seq=12)])
def test_a_brake_lasts_until_the_next_order(motion: Motion) -> None:
    state, _, _ = obey(ARMED, brake())
    lost = on_ready(state, False)
    assert on_tick(lost, NOW + 60 * MS, LEASE, COAST, True)[1] is Command.BRAKE
    state, _, _ = obey(state, motion)
    assert not state.braked
    assert on_tick(state, NOW + LEASE + 1, LEASE, COAST, True)[1] is Command.STOP


def test_what_brakes_whether_it_stands_or_not() -> None:
    assert not ARMED.braking
    assert [lease.braking for lease in (HIT, MOVED, replace(ARMED, braked=True))] == [True] * 3


def test_an_old_run_behind_an_old_zero_is_not_obeyed() -> None:
    after, _, _ = late(replace(ARMED, renewed_ns=NOW - NS_PER_S), run(0.0, seq=11), 3 * NS_PER_S)
    after, order, refusal = late(after, run(seq=12), 3 * NS_PER_S)
    assert (order, refusal) == (None, Refusal.LATE)
    assert on_tick(after, NOW + 3 * NS_PER_S, LEASE, COAST, True)[1] is Command.STOP


def test_a_late_message_of_a_second_authority_is_that_of_a_second_authority() -> None:
    state = replace(ARMED, renewed_ns=NOW + LEASE)
    assert late(state, brake(boot=2), LEASE + 1) == (state, None, Refusal.SECOND_AUTHORITY)


@pytest.mark.parametrize(("age", "obeyed"), [(LEASE - 1, True), (LEASE, True), (LEASE + 1, False)])
def test_lease_holds_for_its_time_and_takes_the_neutral_along(age: int, obeyed: bool) -> None:
    after, order, refusal = obey(ARMED, run(), NOW + age)
    assert (order is Command.RUN) is obeyed
    assert (refusal is Refusal.NOT_NEUTRAL) is not obeyed
    assert after.neutral is obeyed


@pytest.mark.parametrize(
    ("age", "standing", "order"),
    [
        (LEASE, False, None),
        (LEASE + 1, False, Command.STOP),
        (LEASE + 1, True, Command.STOP),
    ],
)
def test_tick_when_the_lease_ends(age: int, standing: bool, order: Command | None) -> None:
    state = replace(ARMED, sent_ns=NOW + age)
    after, sent = on_tick(state, NOW + age, LEASE, COAST, standing)
    assert sent is order
    assert after.neutral is (order is None)


@pytest.mark.parametrize(
    ("age", "standing", "order"),
    [
        (COAST, False, Command.STOP),
        (COAST + 1, False, Command.BRAKE),
        (COAST + 1, True, Command.STOP),
        (60 * NS_PER_S, False, Command.BRAKE),
        (3600 * NS_PER_S, True, Command.STOP),
    ],
)
def test_stop_becomes_break_when_it_does_not_help(age: int, standing: bool, order: Command) -> None:
    over = Lease(over_since_ns=NOW, sent_ns=NOW)
    assert on_tick(over, NOW + age, LEASE, COAST, standing)[1] is order


@pytest.mark.parametrize(("wait", "due"), [(30 * MS - 1, False), (30 * MS, True)])
def test_stop_is_sent_at_every_second_tick(wait: int, due: bool) -> None:
    over = Lease(over_since_ns=NOW, sent_ns=NOW)
    after, order = on_tick(over, NOW + wait, LEASE, COAST, True)
    assert (order is Command.STOP) is due
    assert after.sent_ns == (NOW + wait if due else NOW)


def test_a_lease_that_lives_but_is_not_ready_still_stops() -> None:
    state = replace(ARMED, ready=False, sent_ns=NOW - 50 * MS)
    assert on_tick(state, NOW, LEASE, COAST, False)[1] is Command.STOP


def test_the_frame_of_a_message_counts_for_the_25_hz() -> None:
    state, order, _ = obey(replace(ARMED, ready=False), stop())
    assert order is Command.STOP
    assert on_tick(state, NOW + 30 * MS - 1, LEASE, COAST, False) == (state, None)
    assert on_tick(state, NOW + 30 * MS, LEASE, COAST, False)[1] is Command.STOP


def test_a_message_ends_the_stopping_of_a_lease_that_was_over() -> None:
    over, order = on_tick(ARMED, NOW + LEASE + 1, LEASE, COAST, True)
    assert (over.over_since_ns, over.neutral, order) == (NOW + LEASE + 1, False, Command.STOP)
    alive, _, _ = obey(over, stop(), NOW + NS_PER_S)
    assert (alive.renewed_ns, alive.over_since_ns, alive.neutral) == (NOW + NS_PER_S, None, True)
    assert on_tick(alive, NOW + NS_PER_S + LEASE, LEASE, COAST, True) == (alive, None)
