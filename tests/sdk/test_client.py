"""The client of safety: drive requests, access, contest, E-STOP repetition, reset."""

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule
from msgspec import structs

from common.freshness import NS_PER_S
from t2.client import (
    ESTOP_TICKS,
    KEPT_TICKS,
    NEUTRAL,
    OVERRULED_TICKS,
    ZEROS,
    Access,
    Contest,
    DriveRequests,
    EstopRepetition,
    EstopStep,
    Phase,
    ResetCheck,
    confirms,
    request,
    reset_request,
)
from t2.messages import Cause, Drive, Limits, ResetDone, SafetyState

CONTACT = Cause(name="contact", action="brake", age=1.0, text="", id=41)
ESTOP = Cause(name="estop", action="brake", age=1.0, text="", id=42)
IDLE = Cause(name="no_request", action="stop", age=1.0, text="", id=40)
SEEN = SafetyState(
    verdict="brake", latched=("contact", "estop"), causes=(CONTACT, ESTOP, IDLE), source=None,
    limits=Limits(forward=0, backward=0, angular=0), heartbeat=7, text="", boot=3,
)  # fmt: skip
DONE = ResetDone(text="", boot=3, heartbeat=9, cleared=(41, 42))
AFTER = structs.replace(SEEN, heartbeat=9, latched=(), causes=(IDLE,))

GO = Drive(linear=0.2, angular=0.1, echo=0)
BACK, FORTH = (
    structs.replace(NEUTRAL, release="backward"),
    structs.replace(NEUTRAL, release="forward"),
)

SILENT, DRIVING = DriveRequests(Phase.SILENT), DriveRequests(Phase.DRIVING)
OFF = DriveRequests(Phase.DRIVING, release="backward")

DRIVE_TABLE = [  # before, requested, request, after
    (SILENT, None, None, SILENT),
    (SILENT, GO, NEUTRAL, DRIVING),
    (DRIVING, GO, GO, DRIVING),
    (DRIVING, None, NEUTRAL, DriveRequests(Phase.ENDING, 2)),
    (DriveRequests(Phase.ENDING, 2), None, NEUTRAL, DriveRequests(Phase.ENDING, 1)),
    (DriveRequests(Phase.ENDING, 1), None, NEUTRAL, SILENT),
    (DriveRequests(Phase.ENDING, 2), GO, NEUTRAL, DriveRequests(Phase.DRIVING, 2)),
    (SILENT, BACK, NEUTRAL, OFF),
    (OFF, BACK, BACK, OFF),
    (DRIVING, BACK, NEUTRAL, OFF),
    (OFF, GO, NEUTRAL, DRIVING),
    (OFF, FORTH, NEUTRAL, DriveRequests(Phase.DRIVING, release="forward")),
]


@pytest.mark.parametrize(("before", "requested", "request_", "after"), DRIVE_TABLE)
def test_the_table_of_drive_requests(
    before: DriveRequests, requested: Drive | None, request_: Drive | None, after: DriveRequests
) -> None:
    requests = structs.replace(before)  # the table's own must not change
    assert requests.tick(requested) == request_
    assert requests == after


def test_a_neutral_request_asks_for_nothing() -> None:
    assert request() == NEUTRAL == Drive(linear=0.0, angular=0.0, release="none", echo=0)
    assert request(0.2, 0.1, "forward") == structs.replace(GO, release="forward")
    assert [phase.value for phase in Phase] == ["silent", "driving", "ending"]


@pytest.mark.parametrize("phase", Phase)
def test_stop_sends_three_zeros_from_any_phase(phase: Phase) -> None:
    requests = DriveRequests(phase, 1)
    requests.stop()
    assert [requests.tick(None) for _ in range(5)] == [NEUTRAL] * 3 + [None] * 2


class Driving(RuleBasedStateMachine):
    """Any ticks and stops: what is sent begins and ends each request with zeros."""

    def __init__(self) -> None:
        super().__init__()
        self.requests = DriveRequests()
        self.sent: list[Drive | None] = [None]

    @rule(requested=st.sampled_from([None, NEUTRAL, GO, BACK, FORTH]))
    def tick(self, requested: Drive | None) -> None:
        before, now = self.sent[-1], self.requests.tick(requested)
        assert now in (None, NEUTRAL, requested)
        if now not in (None, NEUTRAL):
            assert before is not None
            assert before == NEUTRAL or before.release == now.release
        if now is None and before is not None:
            assert self.sent[-ZEROS:] == [NEUTRAL] * ZEROS
        self.sent.append(now)

    @rule()
    def stop(self) -> None:
        self.requests.stop()
        assert [self.requests.tick(None) for _ in range(ZEROS + 1)] == [NEUTRAL] * ZEROS + [None]
        self.sent += [*[NEUTRAL] * ZEROS, None]


TestDriving = Driving.TestCase


@pytest.mark.parametrize(
    ("passed_on", "unmatched", "denied"),
    [(False, 8, False), (False, 9, True), (False, 10, False), (True, 9, False), (None, 9, False)],
)
def test_a_client_is_denied_once_its_messages_reach_nobody_for_ten_states(
    passed_on: bool | None, unmatched: int, denied: bool
) -> None:
    access = Access(unmatched=unmatched)
    assert access.received(SEEN, passed_on) is denied
    assert access.echo == SEEN.heartbeat
    assert access.is_denied is (passed_on is False and unmatched >= 9)
    assert access.unmatched == (unmatched + 1 if passed_on is False else 0)
    assert Access() == Access(echo=0, unmatched=0)


@pytest.mark.parametrize(
    ("ticks", "source", "requests", "other", "after"),
    [
        (8, "teleop", True, "teleop", 9),
        (9, "teleop", True, "teleop", OVERRULED_TICKS),
        (9, "teleop", False, "teleop", 0),
        (9, "web", True, None, 0),
        (9, None, True, None, 0),
    ],
)
def test_a_client_is_overruled_after_half_a_second_of_requests(
    ticks: int, source: str | None, requests: bool, other: str | None, after: int
) -> None:
    contest = Contest("web", "nav", ticks)
    contest.tick(structs.replace(SEEN, source=source), requests=requests)
    assert (contest.other, contest.ticks) == (other, after)
    assert contest.is_lost is (after == OVERRULED_TICKS)
    contest.tick(None, requests=True)
    assert (contest.other, contest.ticks) == (None, 0)


def test_without_a_stop_nothing_is_repeated() -> None:
    estop = EstopRepetition()
    assert not estop.is_pending
    assert estop.tick(None) is EstopStep.NONE
    assert estop.tick(AFTER) is EstopStep.NONE
    assert not estop.is_pending


@pytest.mark.parametrize("state", [None, AFTER], ids=["no state", "not latched"])
def test_a_stop_is_repeated_for_a_limited_time(state: SafetyState | None) -> None:
    estop = EstopRepetition()
    estop.start(state)
    steps = [estop.tick(state) for _ in range(61)]
    assert steps == [EstopStep.REPEAT] * 59 + [EstopStep.LAST, EstopStep.NONE]
    assert not estop.is_pending


@pytest.mark.parametrize(
    ("at_start", "states", "repeated"),
    [
        (AFTER, [AFTER, SEEN], 1),
        (AFTER, [SEEN], 0),
        # the latch of an earlier stop, whose reset may be under way
        (SEEN, [SEEN] * 20, KEPT_TICKS - 1),
        (None, [SEEN] * 20, KEPT_TICKS - 1),
        (SEEN, [*[SEEN] * 5, AFTER, SEEN], 6),  # it was reset, and latched anew
        (AFTER, [None, *[SEEN] * 20], KEPT_TICKS),  # what happened meanwhile is unknown
    ],
)
def test_a_latched_stop_is_not_repeated(
    at_start: SafetyState | None, states: list[SafetyState | None], repeated: int
) -> None:
    estop = EstopRepetition()
    estop.start(at_start)
    steps = [estop.tick(state) for state in states]
    assert steps == [EstopStep.REPEAT] * repeated + [EstopStep.NONE] * (len(steps) - repeated)
    assert not estop.is_pending
    assert estop.tick(AFTER) is EstopStep.NONE


def test_a_second_stop_starts_the_time_again() -> None:
    estop = EstopRepetition()
    estop.start(AFTER)
    estop.tick(None)
    estop.start(SEEN)
    assert (estop.ticks, estop.needed) == (ESTOP_TICKS, KEPT_TICKS) == (60, 10)
    estop.start(SEEN, 600)  # a client whose link may be down
    assert estop.ticks == 600
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
