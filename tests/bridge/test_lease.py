"""The lease: state by event, dense where something tips over."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from msgspec.structs import replace as replace_message

from common.freshness import NS_PER_S
from common.messages import Motion
from common.motion import Command
from services.bridge import lease as leases
from services.bridge.lease import (
    SEQ_STEP_MAX,
    Lease,
    Refusal,
    on_estop,
    on_hit,
    on_motion,
    on_ready,
    on_tick,
    on_uncommanded,
)
from tests.bridge.motions import (
    ARMED,
    COAST,
    HIT,
    LEASE,
    MOVED,
    MS,
    NOW,
    OWED,
    OWN_BOOT,
    STOPPED,
    brake,
    obey,
    run,
    stop,
    taking_on,
)


def test_at_first_nobody_may_drive() -> None:
    assert Lease() == Lease(
        boot=None,
        seq=0,
        renewed_ns=0,
        over_since_ns=0,
        ready=False,
        neutral=False,
        hit=None,
        estop=None,
        sent_ns=0,
        latched_by=None,
        braked=False,
        uncommanded=False,
    )


@pytest.mark.parametrize(
    ("state", "motion", "order", "refusal"),
    [
        # armed: everything goes
        (ARMED, run(), Command.RUN, None),
        (ARMED, run(0.0, 0.0), Command.RUN, None),
        (ARMED, run(0.0, 0.1), Command.RUN, None),
        (ARMED, stop(), Command.STOP, None),
        (ARMED, brake(), Command.BRAKE, None),
        # the board is not ready: no RUN, not even of zero
        (replace(ARMED, ready=False), run(), Command.STOP, Refusal.NOT_READY),
        (replace(ARMED, ready=False), run(0.0), Command.STOP, Refusal.NOT_READY),
        (replace(ARMED, ready=False), stop(), Command.STOP, None),
        (replace(ARMED, ready=False), brake(), Command.BRAKE, None),
        # no neutral yet: only what does not move
        (replace(ARMED, neutral=False), run(), Command.STOP, Refusal.NOT_NEUTRAL),
        (replace(ARMED, neutral=False), run(0.0, 0.1), Command.STOP, Refusal.NOT_NEUTRAL),
        (replace(ARMED, neutral=False), run(0.0, 0.0), Command.RUN, None),
        (replace(ARMED, neutral=False), brake(), Command.BRAKE, None),
        # an emergency stop that safety has not latched: BRAKE, whatever is asked
        (STOPPED, run(), Command.BRAKE, Refusal.NOT_ACKED),
        (STOPPED, run(estop=NOW - 1), Command.BRAKE, Refusal.NOT_ACKED),
        (STOPPED, run(estop=NOW), Command.RUN, None),
        (STOPPED, stop(), Command.BRAKE, None),
        # an unjudged hit: BRAKE, whatever is asked
        (HIT, run(), Command.BRAKE, Refusal.NOT_ACKED),
        (HIT, stop(), Command.BRAKE, None),
        (HIT, brake(), Command.BRAKE, None),
        (HIT, run(judged=4, judged_boot=OWN_BOOT), Command.BRAKE, Refusal.NOT_ACKED),
        (HIT, run(judged=5, judged_boot=OWN_BOOT), Command.RUN, None),
        (HIT, run(judged=6, judged_boot=OWN_BOOT), Command.RUN, None),
        (HIT, run(judged=9, judged_boot=OWN_BOOT + 1), Command.BRAKE, Refusal.NOT_ACKED),
        # seq must rise
        (ARMED, run(seq=10), None, Refusal.OLD),
        (ARMED, run(seq=9), None, Refusal.OLD),
        (ARMED, run(seq=12), Command.RUN, None),
        # and not by more than a sender can
        (ARMED, run(seq=10 + SEQ_STEP_MAX), Command.RUN, None),
        (ARMED, run(seq=11 + SEQ_STEP_MAX), None, Refusal.JUMP),
        (ARMED, brake(seq=2**62), None, Refusal.JUMP),
        # the vehicle moved without a command: BRAKE until safety has latched that
        (MOVED, run(), Command.BRAKE, Refusal.NOT_LATCH_OWNER),
        (MOVED, run(0.0, 0.0), Command.BRAKE, Refusal.NOT_LATCH_OWNER),
        (MOVED, stop(), Command.BRAKE, None),
        (MOVED, brake(), Command.BRAKE, None),
        (MOVED, taking_on(brake(), None), Command.BRAKE, None),
        (MOVED, taking_on(stop(), None), Command.BRAKE, None),
        (MOVED, taking_on(stop(), 1), Command.BRAKE, None),
        (MOVED, replace_message(stop(), predecessor=OWN_BOOT), Command.BRAKE, None),
        (MOVED, taking_on(stop(), OWN_BOOT), Command.STOP, None),
        (MOVED, taking_on(brake(), OWN_BOOT), Command.BRAKE, None),
        (MOVED, taking_on(run(), OWN_BOOT), Command.RUN, None),
        (replace(MOVED, hit=5), run(), Command.BRAKE, Refusal.NOT_ACKED),
        (replace(MOVED, hit=5), stop(), Command.BRAKE, None),
        # a second authority
        (ARMED, run(boot=2, seq=99), None, Refusal.SECOND_AUTHORITY),
        (ARMED, brake(boot=2, seq=99), None, Refusal.SECOND_AUTHORITY),
    ],
)
def test_order(
    state: Lease, motion: Motion, order: Command | None, refusal: Refusal | None
) -> None:
    assert obey(state, motion)[1:] == (order, refusal)


def test_a_copied_authority_with_a_huge_seq_locks_nobody_out() -> None:
    after, _, refusal = obey(ARMED, run(seq=2**62))
    assert (after, refusal) == (ARMED, Refusal.JUMP)
    assert obey(after, run(seq=11))[1] is Command.RUN
    assert SEQ_STEP_MAX == 2**20


@pytest.mark.parametrize("age", [LEASE, LEASE + 1])
def test_an_authority_that_was_not_received_for_hours_is_taken_again(age: int) -> None:
    after, order, refusal = obey(ARMED, stop(seq=11 + SEQ_STEP_MAX), NOW + age)
    if age > LEASE:
        assert (after.seq, order, refusal) == (11 + SEQ_STEP_MAX, Command.STOP, None)
    else:
        assert (after, order, refusal) == (ARMED, None, Refusal.JUMP)
    assert obey(ARMED, stop(seq=10), NOW + age)[2] is Refusal.OLD


def test_an_authority_may_begin_at_any_seq() -> None:
    assert obey(Lease(ready=True), stop(seq=2**40))[0].seq == 2**40


def test_moving_without_a_command_breaks_at_once_and_holds() -> None:
    over = replace(ARMED, over_since_ns=NOW - NS_PER_S, neutral=False)
    moved, order = on_uncommanded(over, NOW, OWN_BOOT)
    held = replace(over, uncommanded=True, latched_by=OWN_BOOT, sent_ns=NOW)
    assert (order, moved) == (Command.BRAKE, held)
    assert on_uncommanded(moved, NOW + 1, OWN_BOOT) == (moved, None)
    assert on_tick(moved, NOW + 50 * MS, LEASE, COAST, True)[1] is Command.BRAKE


@pytest.mark.parametrize("owed", [None, 1, 3])
def test_moving_without_a_command_wants_a_reset_of_safety(owed: int | None) -> None:
    over = replace(ARMED, over_since_ns=NOW - NS_PER_S, neutral=False, latched_by=owed)
    moved, _ = on_uncommanded(over, NOW, OWN_BOOT)
    back, order, _ = obey(moved, stop(seq=11))  # it has not received the latch yet
    assert (order, back.uncommanded, back.latched_by) == (Command.BRAKE, True, OWN_BOOT)
    latched, order, _ = obey(back, taking_on(brake(seq=12), OWN_BOOT))
    assert (order, latched.uncommanded, latched.latched_by) == (Command.BRAKE, False, 1)
    reset, order, _ = obey(latched, stop(seq=13))
    assert (order, reset.latched_by) == (Command.STOP, None)
    assert obey(reset, run(seq=14))[1] is Command.RUN


def test_while_the_lease_lives_safety_judges_what_moves() -> None:
    assert on_uncommanded(ARMED, NOW, OWN_BOOT) == (ARMED, None)


@pytest.mark.parametrize("age", [LEASE - 1, LEASE, LEASE + 1])
def test_second_authority_waits_for_the_end_of_the_first(age: int) -> None:
    after, order, refusal = obey(ARMED, run(boot=2, seq=3), NOW + age)
    if age <= LEASE:
        assert (after, order, refusal) == (ARMED, None, Refusal.SECOND_AUTHORITY)
    else:
        assert (after.boot, after.seq, after.neutral) == (2, 3, False)
        assert (order, refusal) == (Command.STOP, Refusal.NOT_NEUTRAL)


def test_the_first_authority_must_be_neutral_too() -> None:
    fresh = Lease(ready=True)
    after, order, _ = obey(fresh, run(seq=1))
    assert order is Command.STOP
    after, order, _ = obey(after, stop(seq=2))
    assert (order, after.neutral) == (Command.STOP, True)
    assert obey(after, run(seq=3))[1] is Command.RUN


@pytest.mark.parametrize("neutral", [stop(), brake(), run(0.0, 0.0)])
def test_neutral_counts_only_while_ready(neutral: Motion) -> None:
    assert obey(replace(ARMED, neutral=False), neutral)[0].neutral
    assert not obey(replace(ARMED, neutral=False, ready=False), neutral)[0].neutral


def test_losing_readiness_takes_the_neutral_and_stops_at_once() -> None:
    lost = on_ready(replace(ARMED, sent_ns=NOW), False)
    assert lost == replace(ARMED, ready=False, neutral=False, sent_ns=leases.AT_ONCE)
    assert on_ready(replace(lost, sent_ns=NOW), True) == replace(ARMED, neutral=False, sent_ns=NOW)
    assert on_tick(lost, NOW, LEASE, COAST, True)[1] is Command.STOP
    again = on_ready(lost, True)
    assert obey(again, run())[1:] == (Command.STOP, Refusal.NOT_NEUTRAL)
    assert on_ready(ARMED, True) is ARMED


def test_the_reflex_breaks_at_once_and_holds_while_time_passes() -> None:
    hit, order = on_hit(ARMED, 42, NOW)
    assert (order, hit.hit, hit.sent_ns) == (Command.BRAKE, 42, NOW)
    over = replace(hit, over_since_ns=NOW)
    assert on_tick(over, NOW + 60 * MS, LEASE, COAST, True)[1] is Command.BRAKE


def test_an_emergency_stop_brakes_at_once_and_holds_until_safety_has_latched_it() -> None:
    lease, order = on_estop(ARMED, NOW)
    assert (lease, order) == (replace(ARMED, estop=NOW, sent_ns=NOW), Command.BRAKE)
    assert on_estop(lease, NOW + MS) == (lease, None)  # repeated until it is confirmed
    over = NOW + LEASE + MS
    lease, order = on_tick(lease, over, LEASE, COAST, True)
    assert order is Command.BRAKE
    lease, order, _ = obey(lease, run(estop=None), over)
    assert order is Command.BRAKE
    lease, order, _ = obey(lease, Motion(command=Command.BRAKE, seq=12, boot=1, estop=NOW), over)
    assert (order, lease.estop) == (Command.BRAKE, None)


def test_it_says_what_it_waits_for() -> None:
    assert ARMED.waiting == ""
    texts = [
        replace(ARMED, ready=False).waiting,
        HIT.waiting,
        STOPPED.waiting,
        replace(ARMED, neutral=False).waiting,
        OWED.waiting,
        replace(MOVED, neutral=False).waiting,
    ]
    assert all(texts)
    assert len(set(texts)) == 6
    assert replace(ARMED, latched_by=1).waiting == ""


motions = st.builds(
    Motion,
    command=st.sampled_from(Command),
    linear=st.sampled_from([0.0, 0.3, -1.0]),
    seq=st.integers(0, 20),
    boot=st.integers(1, 2),
    judged=st.integers(0, 20),
    judged_boot=st.sampled_from([OWN_BOOT, 8]),
    latched=st.booleans(),
    predecessor=st.sampled_from([None, 1, 2, OWN_BOOT]),
)
events = st.lists(
    st.one_of(motions, st.booleans(), st.integers(1, 20), st.sampled_from(["tick", "moved"])),
    max_size=40,
)


@given(events, st.lists(st.integers(0, 300), min_size=40, max_size=40))
def test_no_run_without_everything(happening: list[object], waits_ms: list[int]) -> None:
    """Whatever happens in whatever order: a moving RUN has all its conditions behind it."""
    lease, now = Lease(over_since_ns=NOW), NOW
    for event, wait in zip(happening, waits_ms, strict=False):
        now += wait * MS
        order: Command | None
        if isinstance(event, Motion):
            lease, order, _ = on_motion(lease, event, now, LEASE, OWN_BOOT, received_ns=now)
            if order is Command.RUN and event.linear:
                assert lease.ready
                assert lease.neutral
                assert lease.hit is None
                assert not lease.uncommanded
                assert event.boot == lease.boot
                assert lease.latched_by in (None, event.boot)
        elif isinstance(event, bool):
            lease = on_ready(lease, event)
        elif isinstance(event, int):
            lease, order = on_hit(lease, event, now)
            assert order is Command.BRAKE
        elif event == "moved":
            lease, order = on_uncommanded(lease, now, OWN_BOOT)
            assert order in (None, Command.BRAKE)
        else:
            lease, order = on_tick(lease, now, LEASE, COAST, False)
            assert order is not Command.RUN
        assert lease.over_since_ns is None or not lease.neutral
        assert not lease.uncommanded or lease.latched_by == OWN_BOOT
