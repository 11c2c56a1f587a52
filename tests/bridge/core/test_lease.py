"""The lease: tables of (given, when, then), and its invariants for any order of events."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.motion import BRAKE, RUN, STOP
from services.bridge.core import lease as leases
from services.bridge.core.lease import (
    Lease,
    Refusal,
    on_estop,
    on_hit,
    on_motion,
    on_ready,
    on_tick,
    on_uncommanded,
)
from t2.messages import Command, Motion
from t2.words import render

MS = NS_PER_S // 1000
LEASE, COAST, BEGIN = 200 * MS, 1000 * MS, 3000 * MS
OWN_BOOT = 7
NOW = 100 * NS_PER_S

ARMED = Lease(boot=1, seq=10, renewed_ns=NOW, over_since_ns=None, ready=True, neutral=True)
NOT_READY = replace(ARMED, ready=False)
NOT_NEUTRAL = replace(ARMED, neutral=False)
HIT = replace(ARMED, hit=5)
STOPPED = replace(ARMED, estop=NOW)
MOVED = replace(ARMED, uncommanded=True, latched_by=OWN_BOOT)
OWED = replace(ARMED, latched_by=3)  # by one that has ended
BEGUN = Lease(over_since_ns=NOW, sent_ns=NOW)
OVER = replace(BEGUN, boot=1)


def run(linear: float = 0.5, angular: float = 0.0, *, seq: int = 11, **more: Any) -> Motion:
    return Motion(command=RUN, linear=linear, angular=angular, seq=seq, **{"boot": 1} | more)


def stop(seq: int = 11, boot: int = 1) -> Motion:
    return Motion(command=STOP, seq=seq, boot=boot)


def brake(seq: int = 11, boot: int = 1) -> Motion:
    return Motion(command=BRAKE, seq=seq, boot=boot)


def taking_on(motion: Motion, predecessor: int | None) -> Motion:
    """Return it from a sender that has latched, and knows of this one before it."""
    return replace(motion, latched=True, predecessor=predecessor)


def obey(
    lease: Lease, motion: Motion, now_ns: int = NOW, waited_ns: int = 0
) -> tuple[Lease, Command | None, Refusal | None]:
    received_ns = now_ns - waited_ns
    return on_motion(lease, motion, now_ns, LEASE, OWN_BOOT, received_ns=received_ns)


@pytest.mark.parametrize(
    ("given", "when", "order", "refusal"),
    [
        # armed: everything goes
        (ARMED, run(), RUN, None),
        (ARMED, run(0.0, 0.0), RUN, None),
        (ARMED, run(0.0, 0.1), RUN, None),
        (ARMED, stop(), STOP, None),
        (ARMED, brake(), BRAKE, None),
        # the board is not ready: no RUN, not even of zero
        (NOT_READY, run(), STOP, Refusal.NOT_READY),
        (NOT_READY, run(0.0), STOP, Refusal.NOT_READY),
        (NOT_READY, stop(), STOP, None),
        (NOT_READY, brake(), BRAKE, None),
        # no neutral yet: only what does not move
        (NOT_NEUTRAL, run(), STOP, Refusal.NOT_NEUTRAL),
        (NOT_NEUTRAL, run(0.0, 0.1), STOP, Refusal.NOT_NEUTRAL),
        (NOT_NEUTRAL, run(0.0, 0.0), RUN, None),
        (NOT_NEUTRAL, brake(), BRAKE, None),
        # an emergency stop that safety has not latched: BRAKE, whatever is commanded
        (STOPPED, run(), BRAKE, Refusal.ESTOP),
        (STOPPED, run(estop=NOW - 1), BRAKE, Refusal.ESTOP),
        (STOPPED, run(estop=NOW), RUN, None),
        (STOPPED, stop(), BRAKE, None),
        # a hit that safety has not acknowledged: likewise
        (HIT, run(), BRAKE, Refusal.HIT),
        (HIT, stop(), BRAKE, None),
        (HIT, brake(), BRAKE, None),
        (HIT, run(judged=4, judged_boot=OWN_BOOT), BRAKE, Refusal.HIT),
        (HIT, run(judged=5, judged_boot=OWN_BOOT), RUN, None),
        (HIT, run(judged=6, judged_boot=OWN_BOOT), RUN, None),
        (HIT, run(judged=9, judged_boot=OWN_BOOT + 1), BRAKE, Refusal.HIT),
        # seq must rise
        (ARMED, run(seq=10), None, Refusal.OLD),
        (ARMED, run(seq=9), None, Refusal.OLD),
        (ARMED, run(seq=12), RUN, None),
        # the vehicle moved without a command: BRAKE until safety has latched that
        (MOVED, run(), BRAKE, Refusal.UNCOMMANDED),
        (MOVED, run(0.0, 0.0), BRAKE, Refusal.UNCOMMANDED),
        (MOVED, stop(), BRAKE, None),
        (MOVED, brake(), BRAKE, None),
        (MOVED, taking_on(brake(), None), BRAKE, None),
        (MOVED, taking_on(stop(), None), BRAKE, None),
        (MOVED, taking_on(stop(), 1), BRAKE, None),
        (MOVED, replace(stop(), predecessor=OWN_BOOT), BRAKE, None),
        (MOVED, taking_on(stop(), OWN_BOOT), STOP, None),
        (MOVED, taking_on(brake(), OWN_BOOT), BRAKE, None),
        (MOVED, taking_on(run(), OWN_BOOT), RUN, None),
        (replace(MOVED, hit=5), run(), BRAKE, Refusal.HIT),
        (replace(MOVED, hit=5), stop(), BRAKE, None),
        # a latch: its own authority may creep, another must take it over
        (replace(ARMED, latched_by=1), run(), RUN, None),
        (OWED, run(), STOP, Refusal.NOT_LATCH_OWNER),
        (OWED, run(0.0), STOP, Refusal.NOT_LATCH_OWNER),
        (OWED, stop(), STOP, None),
        (OWED, brake(), BRAKE, None),
        (OWED, taking_on(run(), 3), RUN, None),
        (OWED, taking_on(run(), None), STOP, Refusal.NOT_LATCH_OWNER),
        (OWED, taking_on(run(), 4), STOP, Refusal.NOT_LATCH_OWNER),
        # a second authority
        (ARMED, run(boot=2, seq=99), None, Refusal.SECOND_AUTHORITY),
        (ARMED, brake(boot=2, seq=99), None, Refusal.SECOND_AUTHORITY),
    ],
)
def test_order(given: Lease, when: Motion, order: Command | None, refusal: Refusal | None) -> None:
    assert obey(given, when)[1:] == (order, refusal)


# --- authorities and latches --------------------------------------------------------------------


@pytest.mark.parametrize("age", [LEASE - 1, LEASE, LEASE + 1])
def test_a_second_authority_waits_for_the_end_of_the_first(age: int) -> None:
    motion = replace(run(boot=2, seq=3), latched=True)
    after, order, refusal = obey(ARMED, motion, NOW + age)
    if age <= LEASE:
        assert (after, order, refusal) == (ARMED, None, Refusal.SECOND_AUTHORITY)
    else:
        assert (after.boot, after.seq, after.neutral, after.latched_by) == (2, 3, False, 2)
        assert (order, refusal) == (STOP, Refusal.NOT_NEUTRAL)


def test_the_first_authority_must_be_neutral_too() -> None:
    after, order, _ = obey(Lease(ready=True), run(seq=2**40))
    assert (order, after.seq) == (STOP, 2**40)
    after, order, _ = obey(after, stop(seq=2**40 + 1))
    assert (order, after.neutral) == (STOP, True)
    assert obey(after, run(seq=2**40 + 2))[1] is RUN


def test_a_latch_is_remembered_until_its_owner_resets_it() -> None:
    latched, _, _ = obey(ARMED, replace(brake(), latched=True))
    assert latched.latched_by == 1
    lease, later = latched, NOW + LEASE + 1
    for motion, owner in (
        (stop(1, boot=2), 1),  # has not received the latch yet
        (taking_on(brake(2, boot=2), None), 1),  # latches for its own reason
        (replace(stop(3, boot=2), predecessor=1), 1),
        (taking_on(brake(4, boot=2), 1), 2),
        (taking_on(brake(5, boot=2), 1), 2),  # has not received its own latch yet
        (stop(6, boot=2), None),
    ):
        lease, _, _ = obey(lease, motion, later)
        assert lease.latched_by == owner


@pytest.mark.parametrize("owed", [None, 1, 3])
def test_moving_without_a_command_wants_a_reset_of_safety(owed: int | None) -> None:
    over = replace(ARMED, over_since_ns=NOW - NS_PER_S, neutral=False, latched_by=owed)
    lease, order = on_uncommanded(over, NOW, OWN_BOOT)
    held = replace(over, uncommanded=True, latched_by=OWN_BOOT, sent_ns=NOW)
    assert (order, lease) == (BRAKE, held)
    assert on_uncommanded(lease, NOW + 1, OWN_BOOT) == (lease, None)
    assert on_tick(lease, NOW + 50 * MS, LEASE, COAST, True)[1] is BRAKE
    for motion, expected, uncommanded, owner in (
        (stop(seq=11), BRAKE, True, OWN_BOOT),  # it has not received the latch yet
        (taking_on(brake(seq=12), OWN_BOOT), BRAKE, False, 1),
        (stop(seq=13), STOP, False, None),
        (run(seq=14), RUN, False, None),
    ):
        lease, order, _ = obey(lease, motion)
        assert (order, lease.uncommanded, lease.latched_by) == (expected, uncommanded, owner)


def test_while_the_lease_is_valid_safety_supervises_the_vehicle() -> None:
    assert on_uncommanded(ARMED, NOW, OWN_BOOT) == (ARMED, None)


# --- readiness, hits and emergency stops ----------------------------------------------------------


def test_losing_readiness_takes_the_neutral_and_stops_at_once() -> None:
    lost = on_ready(replace(ARMED, sent_ns=NOW), False)
    assert lost == replace(ARMED, ready=False, neutral=False, sent_ns=leases.AT_ONCE)
    assert on_ready(replace(lost, sent_ns=NOW), True) == replace(NOT_NEUTRAL, sent_ns=NOW)
    assert on_tick(lost, NOW, LEASE, COAST, True)[1] is STOP
    assert on_tick(lost, NOW, LEASE, 0, False)[1] is STOP  # its lease is valid, so it coasts for 0
    assert on_tick(replace(lost, renewed_ns=0), 0, LEASE, COAST, True)[1] is STOP
    assert obey(on_ready(lost, True), run())[1:] == (STOP, Refusal.NOT_NEUTRAL)
    assert on_ready(ARMED, True) is ARMED


def test_an_emergency_stop_brakes_at_once_and_until_safety_has_latched_it() -> None:
    lease, order = on_estop(ARMED, NOW)
    assert (lease, order) == (replace(ARMED, estop=NOW, sent_ns=NOW), BRAKE)
    assert on_estop(lease, NOW + MS) == (lease, None)  # repeated until it is confirmed
    braked = replace(ARMED, braked=True)
    assert on_estop(braked, NOW) == (replace(braked, estop=NOW), None)  # the board holds BRAKE
    ended = replace(braked, over_since_ns=NOW - MS)
    assert on_estop(ended, NOW) == (replace(ended, estop=NOW, sent_ns=NOW), BRAKE)
    over = NOW + LEASE + MS
    lease, order = on_tick(lease, over, LEASE, COAST, True)
    assert order is BRAKE
    lease, order, _ = obey(lease, run(), over)
    assert order is BRAKE
    lease, order, _ = obey(lease, replace(brake(12), estop=NOW), over)
    assert (order, lease.estop) == (BRAKE, None)


def test_each_reason_to_wait_has_its_text() -> None:
    waiting = (NOT_READY, HIT, STOPPED, NOT_NEUTRAL, OWED, replace(MOVED, neutral=False))
    texts = [lease.waiting for lease in waiting]
    assert all(texts)
    assert len(set(map(render, texts))) == 6
    assert ARMED.waiting == replace(ARMED, latched_by=1).waiting == ()


# --- the end of the lease -------------------------------------------------------------------------


@pytest.mark.parametrize("waited", [0, LEASE])
def test_the_lease_counts_from_the_reception_of_a_motion(waited: int) -> None:
    state = replace(ARMED, renewed_ns=NOW + waited)
    after, order, refusal = obey(state, run(), NOW + waited, waited)
    assert (order, refusal) == (RUN, None)
    assert (after.renewed_ns, after.sent_ns) == (NOW, NOW + waited)
    assert on_tick(after, NOW + LEASE, LEASE, COAST, True)[1] is None
    assert on_tick(after, NOW + LEASE + 1, LEASE, COAST, True)[1] is STOP


@pytest.mark.parametrize(
    ("motion", "order"), [(run(), None), (run(0.0), None), (stop(), None), (brake(), BRAKE)]
)
def test_what_waited_for_longer_than_the_lease_renews_nothing(
    motion: Motion, order: Command | None
) -> None:
    state = replace(NOT_NEUTRAL, renewed_ns=NOW + LEASE)
    after = replace(state, braked=order is BRAKE)
    assert obey(state, motion, NOW + LEASE + 1, LEASE + 1) == (after, order, Refusal.LATE)
    second = replace(motion, boot=2)
    refused = (state, None, Refusal.SECOND_AUTHORITY)
    assert obey(state, second, NOW + LEASE + 1, LEASE + 1) == refused


def test_an_old_run_behind_an_old_zero_is_not_obeyed() -> None:
    state = replace(ARMED, renewed_ns=NOW - NS_PER_S)
    for motion in (run(0.0), run(seq=12)):
        state, order, refusal = obey(state, motion, NOW + 3 * NS_PER_S, 3 * NS_PER_S)
        assert (order, refusal) == (None, Refusal.LATE)
    assert on_tick(state, NOW + 3 * NS_PER_S, LEASE, COAST, True)[1] is STOP


@pytest.mark.parametrize("waited", [0, LEASE + 1])
def test_a_brake_goes_on_when_the_lease_ends(waited: int) -> None:
    state, order, _ = obey(ARMED, brake(), NOW + waited, waited)
    assert (order, state.braked) == (BRAKE, True)
    over, order = on_tick(state, NOW + LEASE + 1, LEASE, COAST, True)
    assert order is BRAKE
    assert on_tick(over, NOW + 3600 * NS_PER_S, LEASE, COAST, True)[1] is BRAKE


@pytest.mark.parametrize("motion", [stop(12), run(seq=12), run(0.0, seq=12)])
def test_a_brake_lasts_until_the_next_order(motion: Motion) -> None:
    state, _, _ = obey(ARMED, brake())
    assert on_tick(on_ready(state, False), NOW + 60 * MS, LEASE, COAST, True)[1] is BRAKE
    state, _, _ = obey(state, motion)
    assert not state.braked
    assert on_tick(state, NOW + LEASE + 1, LEASE, COAST, True)[1] is STOP


@pytest.mark.parametrize(("age", "obeyed"), [(LEASE - 1, True), (LEASE, True), (LEASE + 1, False)])
def test_the_lease_ends_and_takes_the_neutral_along(age: int, obeyed: bool) -> None:
    after, order, refusal = obey(ARMED, run(), NOW + age)
    assert (order is RUN) is after.neutral is obeyed
    assert (refusal is Refusal.NOT_NEUTRAL) is not obeyed
    ticked, sent = on_tick(replace(ARMED, sent_ns=NOW + age), NOW + age, LEASE, COAST, False)
    assert sent is (None if obeyed else STOP)
    assert ticked.neutral is obeyed
    assert ticked.over_since_ns == (None if obeyed else NOW + age)


@pytest.mark.parametrize(
    ("given", "age", "standing", "order"),
    [
        # STOP at every second tick
        (OVER, 30 * MS - 1, True, None),
        (OVER, 30 * MS, True, STOP),
        (replace(NOT_READY, sent_ns=NOW), 30 * MS - 1, False, None),
        (replace(NOT_READY, sent_ns=NOW), 30 * MS, False, STOP),
        (replace(ARMED, sent_ns=NOW), 30 * MS, False, None),
        # BRAKE when it does not stand after the coast limit
        (OVER, COAST, False, STOP),
        (OVER, COAST + 1, False, BRAKE),
        (OVER, COAST + 1, True, STOP),
        (OVER, 60 * NS_PER_S, False, BRAKE),
        (OVER, 3600 * NS_PER_S, True, STOP),
        # At the start the guard's BRAKE continues: for 3 s, or without a limit if it was held
        (BEGUN, 30 * MS - 1, True, None),
        (BEGUN, 30 * MS, True, BRAKE),
        (BEGUN, BEGIN, True, BRAKE),
        (BEGUN, BEGIN + 1, True, STOP),
        (BEGUN, BEGIN + 1, False, BRAKE),
        (replace(BEGUN, braked=True), 3600 * NS_PER_S, True, BRAKE),
    ],
)
def test_what_is_due(given: Lease, age: int, standing: bool, order: Command | None) -> None:
    after, sent = on_tick(given, NOW + age, LEASE, COAST, standing)
    assert sent is order
    assert after.sent_ns == (NOW + age if order else NOW)


# --- in any order ---------------------------------------------------------------------------------

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
    estop=st.sampled_from([None, NOW]),
)


class Events(RuleBasedStateMachine):
    """Whatever happens in whatever order: a moving RUN has all its conditions behind it."""

    def __init__(self) -> None:
        super().__init__()
        self.now_ns = NOW
        self.lease = Lease(over_since_ns=NOW)

    @rule(milliseconds=st.integers(0, 300), standing=st.booleans())
    def tick(self, milliseconds: int, standing: bool) -> None:
        self.now_ns += milliseconds * MS
        self.lease, order = on_tick(self.lease, self.now_ns, LEASE, COAST, standing)
        assert order is not RUN
        assert order is not STOP or not self.lease.braking

    @rule(motion=motions, waited_ms=st.sampled_from([0, 0, 0, 200, 201]))
    def move(self, motion: Motion, waited_ms: int) -> None:
        before = self.lease
        self.lease, order, _ = obey(before, motion, self.now_ns, waited_ms * MS)
        if order is RUN and motion.linear:
            assert before.ready
            assert before.neutral
            assert self.lease.hit is self.lease.estop is None
            assert not self.lease.uncommanded
            assert motion.boot == self.lease.boot
            assert self.lease.latched_by in (None, motion.boot)
            assert waited_ms * MS <= LEASE
        assert order is not None or self.lease == before or motion.boot != before.boot

    @rule(change=st.sampled_from(["ready", "not ready", "hit", "estop", "moved"]))
    def change(self, change: str) -> None:
        changes: dict[str, Callable[[], Lease]] = {
            "ready": lambda: on_ready(self.lease, True),
            "not ready": lambda: on_ready(self.lease, False),
            "hit": lambda: on_hit(self.lease, 10, self.now_ns),
            "estop": lambda: on_estop(self.lease, NOW)[0],
            "moved": lambda: on_uncommanded(self.lease, self.now_ns, OWN_BOOT)[0],
        }
        self.lease = changes[change]()

    @invariant()
    def no_neutral_after_the_end(self) -> None:
        assert self.lease.over_since_ns is None or not self.lease.neutral
        assert not self.lease.uncommanded or self.lease.latched_by == OWN_BOOT


TestEvents = Events.TestCase
