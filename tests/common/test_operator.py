"""Requests and calls of an operator: drive requests, E-STOP repetition, reset, echoes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from common.freshness import NS_PER_S
from common.messages import Cause, Limits, ResetDone, SafetyState
from common.motion import Twist
from common.operator import (
    AHEAD,
    CONFIRM_S,
    ESTOP_TICKS,
    MAX_CALL_AGE_NS,
    NEUTRAL,
    ZEROS,
    DriveRequests,
    Echoes,
    EstopRepetition,
    EstopStep,
    Phase,
    Request,
    ResetCheck,
    confirms,
    reset_request,
)

CONTACT = Cause(name="contact", action="brake", age=1.0, text="", id=41)
ESTOP = Cause(name="estop", action="brake", age=1.0, text="", id=42)
IDLE = Cause(name="no_request", action="stop", age=1.0, text="", id=40)
SEEN = SafetyState(
    verdict="brake", latched=("contact", "estop"), causes=(CONTACT, ESTOP, IDLE), source=None,
    limits=Limits(forward=0, backward=0, angular=0), heartbeat=7, text="", boot=3,
)  # fmt: skip
DONE = ResetDone(text="", boot=3, heartbeat=9, cleared=(41, 42))
AFTER = structs.replace(SEEN, heartbeat=9, latched=(), causes=(IDLE,))

GO = Request(Twist(0.2, 0.1))
BACK, FORTH = Request(release="backward"), Request(release="forward")

SILENT, DRIVING = DriveRequests(Phase.SILENT), DriveRequests(Phase.DRIVING)
OFF = DriveRequests(Phase.DRIVING, release="backward")

DRIVE_TABLE = [  # before, requested, request, after
    (SILENT, None, None, SILENT),
    (SILENT, GO, NEUTRAL, DRIVING),
    (DRIVING, GO, GO, DRIVING),
    (DRIVING, None, NEUTRAL, DriveRequests(Phase.RELEASING, 2)),
    (DriveRequests(Phase.RELEASING, 2), None, NEUTRAL, DriveRequests(Phase.RELEASING, 1)),
    (DriveRequests(Phase.RELEASING, 1), None, NEUTRAL, SILENT),
    (DriveRequests(Phase.RELEASING, 2), GO, NEUTRAL, DriveRequests(Phase.DRIVING, 2)),
    (SILENT, BACK, NEUTRAL, OFF),
    (OFF, BACK, BACK, OFF),
    (DRIVING, BACK, NEUTRAL, OFF),
    (OFF, GO, NEUTRAL, DRIVING),
    (OFF, FORTH, NEUTRAL, DriveRequests(Phase.DRIVING, release="forward")),
]


@pytest.mark.parametrize(("before", "requested", "request_", "after"), DRIVE_TABLE)
def test_the_table_of_drive_requests(
    before: DriveRequests, requested: Request | None, request_: Request | None, after: DriveRequests
) -> None:
    requests = structs.replace(before)  # the table's own must not change
    assert requests.tick(requested) == request_
    assert requests == after


def test_a_twist_is_zero_by_default() -> None:
    assert Request(Twist(0.0, 0.0), "none") == NEUTRAL
    assert [phase.value for phase in Phase] == ["silent", "driving", "releasing"]


@pytest.mark.parametrize("phase", Phase)
def test_stop_sends_three_zeros_from_any_phase(phase: Phase) -> None:
    requests = DriveRequests(phase, 1)
    requests.stop()
    assert [requests.tick(None) for _ in range(5)] == [NEUTRAL] * 3 + [None] * 2


@given(st.lists(st.sampled_from(["go", "idle", "stop"])))
def test_a_drive_begins_with_a_zero_and_ends_with_three(steps: list[str]) -> None:
    requests = DriveRequests()
    sent = []
    for step in [*steps, *["idle"] * (ZEROS + 1)]:
        if step == "stop":
            requests.stop()
        else:
            sent.append(requests.tick(GO if step == "go" else None))
    assert sent[-1] is None
    for i, request in enumerate(sent):
        if request == GO:
            assert sent[i - 1] in (GO, NEUTRAL)
            assert i > 0
            assert sent[i + 1] is not None  # a zero or another twist, never silence


def test_without_a_stop_nothing_is_repeated() -> None:
    estop = EstopRepetition()
    assert not estop.is_pending
    assert estop.tick(None) is EstopStep.NONE
    assert estop.tick(AFTER) is EstopStep.NONE
    assert not estop.is_pending


@pytest.mark.parametrize("state", [None, AFTER], ids=["no state", "not latched"])
def test_a_stop_is_repeated_for_a_limited_time(state: SafetyState | None) -> None:
    estop = EstopRepetition()
    estop.start()
    steps = [estop.tick(state) for _ in range(61)]
    assert steps == [EstopStep.REPEAT] * 59 + [EstopStep.LAST, EstopStep.NONE]
    assert not estop.is_pending


def test_a_latched_stop_is_not_repeated() -> None:
    estop = EstopRepetition()
    estop.start()
    assert estop.tick(AFTER) is EstopStep.REPEAT
    assert estop.tick(SEEN) is EstopStep.NONE
    assert not estop.is_pending
    assert estop.tick(AFTER) is EstopStep.NONE


def test_a_second_stop_starts_the_time_again() -> None:
    estop = EstopRepetition()
    estop.start()
    estop.tick(None)
    estop.start()
    assert estop.ticks == ESTOP_TICKS == 60
    assert len({step.value for step in EstopStep}) == len(EstopStep) == 3


def test_before_the_answer_a_reset_is_open() -> None:
    check = ResetCheck(SEEN)
    assert not check.is_answered
    assert check.outcome(AFTER, 1 << 62) is None


@pytest.mark.parametrize(
    ("state", "confirmed"),
    [
        (AFTER, True),
        (structs.replace(AFTER, heartbeat=8), False),  # from before the reset
        (structs.replace(AFTER, boot=4), False),  # of another safety service
        (structs.replace(SEEN, heartbeat=9), False),  # the causes are still there
        (None, False),
    ],
)
def test_only_a_state_of_safety_confirms_a_reset(
    state: SafetyState | None, confirmed: bool
) -> None:
    check = ResetCheck(SEEN)
    check.answer(DONE)
    assert check.is_answered
    assert check.outcome(None, 10 * NS_PER_S) is None
    assert check.outcome(state, 11 * NS_PER_S) is (True if confirmed else None)
    assert check.outcome(state, 11 * NS_PER_S + 1) is confirmed


def test_the_time_for_a_confirmation_starts_at_the_first_look() -> None:
    check = ResetCheck(SEEN)
    check.answer(DONE)
    for seconds in (100.0, 100.5, 100.0 + CONFIRM_S):
        assert check.outcome(None, round(seconds * NS_PER_S)) is None
    assert check.outcome(None, round((100.0 + CONFIRM_S) * NS_PER_S) + 1) is False


def test_a_reset_names_the_latched_causes_that_were_seen() -> None:
    request = reset_request(SEEN)
    assert (request.echo, request.causes) == (7, (41, 42))


def test_a_reset_is_confirmed_by_the_state_alone() -> None:
    assert confirms(SEEN, DONE, AFTER)
    assert not confirms(SEEN, DONE, SEEN)  # older than the effect
    assert not confirms(SEEN, DONE, structs.replace(AFTER, causes=(ESTOP,)))  # one is left
    assert confirms(SEEN, structs.replace(DONE, cleared=(42,)), AFTER)
    assert not confirms(SEEN, structs.replace(DONE, boot=4), AFTER)  # from another program
    assert not confirms(SEEN, structs.replace(DONE, cleared=()), AFTER)  # claims nothing
    assert not confirms(SEEN, structs.replace(DONE, cleared=(40,)), AFTER)  # was not latched
    assert not confirms(SEEN, structs.replace(DONE, cleared=(41, 99)), AFTER)  # was not there
    assert not confirms(SEEN, DONE, structs.replace(AFTER, boot=4))  # another safety service now
    other = structs.replace(AFTER, boot=4), structs.replace(DONE, boot=4)
    assert not confirms(SEEN, other[1], other[0])


def test_echoes_have_the_time_when_their_state_was_received() -> None:
    echoes = Echoes()
    assert "no echo" in echoes.refusal(None, 0)
    assert "unknown" in echoes.refusal(7, 0)
    echoes = echoes.received(SEEN, 100)
    assert echoes.refusal(7, 100 + MAX_CALL_AGE_NS) == ""
    assert "allowed is 1 s" in echoes.refusal(7, 101 + MAX_CALL_AGE_NS)
    assert "unknown" in echoes.refusal(6, 100)
    newer = echoes.received(structs.replace(SEEN, heartbeat=8), 100 + MAX_CALL_AGE_NS)
    assert "allowed is 1 s" in newer.refusal(7, 101 + MAX_CALL_AGE_NS)
    assert newer.refusal(8, 101 + MAX_CALL_AGE_NS) == ""


def test_another_start_of_safety_makes_old_echoes_unknown() -> None:
    echoes = (
        Echoes().received(SEEN, 100).received(structs.replace(SEEN, heartbeat=900, boot=4), 200)
    )
    assert "unknown" in echoes.refusal(7, 200)
    assert echoes.refusal(900, 200) == ""


def test_an_echo_may_be_slightly_ahead_of_the_newest_state() -> None:
    echoes = Echoes().received(SEEN, 100)
    assert echoes.refusal(7 + AHEAD, 100) == ""
    assert "unknown" in echoes.refusal(8 + AHEAD, 100)
    assert "allowed is 1 s" in echoes.refusal(8, 101 + MAX_CALL_AGE_NS)  # safety is silent now
