"""Calls of the operator through the controller: reset and release, on a bus that never opens."""

import pytest
from msgspec import structs

from common import keys
from common.bus.publisher import Publisher
from common.messages import Direction, Done, ReleaseRequest, ResetDone, ResetRequest
from common.operator import BUMPER_FREE, no_answer, not_allowed
from common.source import DENIED_AFTER
from tests.teleop.support import Operator

DONE = ResetDone(text="cleared contact", boot=5, heartbeat=8, cleared=(42,))


def test_a_reset_clears_the_shown_causes_and_is_confirmed(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    request = ResetRequest(echo=7, causes=(42,))
    assert operator.node.fake.asked == [(keys.RESET.path, request)]
    operator.node.fake.answers[0][0](DONE)
    operator.ticks(1)
    for _ in range(60):
        operator.tell_safety(boot=5, heartbeat=8)
        operator.ticks(1)
    assert operator.lines == ["reset: cleared contact"]


def test_a_reset_without_effect_is_not_confirmed(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.node.fake.answers[0][0](DONE)
    for _ in range(20):  # the latch stays
        operator.tell_contact(heartbeat=8)
        operator.ticks(1)
    assert operator.lines == ["reset: cleared contact"]
    assert_unconfirmed(operator)


def test_a_reset_that_another_program_answers_is_not_confirmed(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.node.fake.answers[0][0](structs.replace(DONE, boot=77))
    for _ in range(20):
        operator.tell_safety(boot=5, heartbeat=8)
        operator.ticks(1)
    assert_unconfirmed(operator)


def assert_unconfirmed(operator: Operator) -> None:
    operator.ticks(3)
    (line,) = (line for line in operator.node.event_log.lines() if "NOT CONFIRMED" in line.text)
    assert line.level == "error"


def test_a_refused_reset_is_reported_and_the_next_one_is_sent(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.press("r")  # the key repeats
    assert len(operator.node.fake.asked) == 1
    operator.node.fake.answers[0][1]("The call is 5.0 s old, allowed is 0.4 s: repeat it.")
    operator.ticks(5)
    assert operator.lines == ["reset refused: The call is 5.0 s old, allowed is 0.4 s: repeat it."]
    operator.tell_contact()
    operator.press("r")
    assert len(operator.node.fake.asked) == 2


@pytest.mark.parametrize(("key", "what"), [("r", "reset"), ("b", "release")])
@pytest.mark.parametrize("denied", [True, False])
def test_an_unanswered_call_without_the_right_is_not_allowed(
    operator: Operator, monkeypatch: pytest.MonkeyPatch, key: str, what: str, denied: bool
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", not denied)
    for _ in range(DENIED_AFTER):
        operator.tell_contact()
        operator.ticks(1)
    operator.press(key)
    operator.ticks(1)
    operator.node.fake.answers[0][1](no_answer("safety"))
    reason = not_allowed("safety") if denied else no_answer("safety")
    assert operator.lines[-1] == f"{what} refused: {reason}"


def test_a_new_reset_replaces_one_that_waits_for_its_state(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.node.fake.answers[0][0](DONE)
    operator.press("r")
    assert len(operator.node.fake.asked) == 2
    operator.node.fake.answers[0][1]("late")  # of the first one
    operator.press("r")
    assert len(operator.node.fake.asked) == 2


@pytest.mark.parametrize("shown", [True, False])
def test_a_reset_is_not_sent_without_a_fresh_state(operator: Operator, shown: bool) -> None:
    operator.tell_contact()
    if not shown:
        operator.shown = None
    else:
        operator.wait(0.6)
    operator.press("r")
    assert operator.node.fake.asked == []
    assert operator.lines == ["reset not sent: no fresh state of safety"]


@pytest.mark.parametrize(("key", "direction"), [("f", "forward"), ("b", "backward")])
def test_a_release_is_repeated_while_held_one_at_a_time(
    operator: Operator, key: str, direction: Direction
) -> None:
    fake = operator.node.fake
    operator.tell_contact()
    operator.press(key)
    operator.ticks(3)
    held = ReleaseRequest(direction=direction, echo=7)
    assert fake.asked == [(keys.RELEASE.path, held)]  # the first is not answered yet
    fake.answers[-1][0](Done(text="0.15 m left"))
    operator.tell_contact(heartbeat=8)
    operator.ticks(1)
    fake.answers[-1][0](Done(text="0.14 m left"))
    operator.ticks(1)
    fake.answers[-1][1]("safety does not answer")
    operator.ticks(1)
    fake.answers[-1][1]("safety does not answer")
    assert operator.controller.view.release == direction
    assert [request.echo for _, request in fake.asked] == [7, 8, 8, 8]
    for _ in range(20):
        operator.tell_contact(heartbeat=9)
        operator.ticks(1)
    assert fake.asked[-1][1] == ReleaseRequest(held=False, echo=9)
    released: Direction | None = operator.controller.view.release
    assert released is None
    fake.answers[-1][0](Done(text="released"))
    count = len(fake.asked)
    operator.ticks(5)
    assert len(fake.asked) == count
    assert operator.lines == ["release: 0.15 m left", "release refused: safety does not answer"]


def test_a_held_release_reports_once_that_the_bumper_is_free(operator: Operator) -> None:
    operator.tell_contact()
    for text in ("0.15 m left", BUMPER_FREE, BUMPER_FREE):
        operator.press("b")
        operator.ticks(1)
        operator.node.fake.answers[-1][0](Done(text=text))
    lines = operator.node.event_log.lines()
    assert [(line.level, line.text) for line in lines] == [
        ("info", "release: 0.15 m left"),
        ("info", f"release: {BUMPER_FREE}"),
    ]


def test_a_release_is_not_sent_without_a_fresh_state(operator: Operator) -> None:
    operator.press("b")
    operator.ticks(5)
    assert operator.node.fake.asked == []
    assert operator.lines == ["release not sent: no fresh state of safety"]
    operator.ticks(20)
    (request,) = operator.node.fake.asked  # an end is sent in any case
    assert request[1] == ReleaseRequest(held=False)


def test_a_release_in_the_other_direction_ends_the_first_one(operator: Operator) -> None:
    fake = operator.node.fake
    operator.tell_contact(heartbeat=7)
    operator.press("f")
    operator.ticks(1)
    fake.answers[-1][0](Done(text="0.15 m left"))
    operator.press("b")
    operator.ticks(3)  # safety takes no hold that echoes the end: wait for its next state
    operator.tell_contact(heartbeat=8)
    operator.ticks(2)
    assert [request for _, request in fake.asked] == [
        ReleaseRequest(direction="forward", echo=7),
        ReleaseRequest(held=False, echo=7),
        ReleaseRequest(direction="backward", echo=8),
    ]


def test_the_answer_to_an_end_does_not_complete_a_hold(operator: Operator) -> None:
    fake = operator.node.fake
    operator.tell_contact(heartbeat=7)
    operator.press("f")
    operator.ticks(1)
    operator.press("b")
    operator.tell_contact(heartbeat=8)
    operator.ticks(1)
    fake.answers[1][0](Done(text="Let go."))
    fake.answers[1][1]("late")
    operator.tell_contact(heartbeat=9)
    operator.ticks(1)
    assert len(fake.asked) == 2  # the first hold is not answered yet
    fake.answers[0][1]("safety does not answer")
    operator.ticks(1)
    assert fake.asked[-1][1] == ReleaseRequest(direction="backward", echo=9)


def test_a_release_sends_no_requests_to_move(operator: Operator) -> None:
    operator.press("f")
    assert operator.speeds(5) == [None] * 5
