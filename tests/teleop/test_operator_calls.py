"""The operator's reset through the controller, on a bus that never opens."""

import pytest
from msgspec import structs

from common import keys
from common.bus.publisher import Publisher
from common.messages import ResetDone, ResetRequest
from common.operator import no_answer, not_allowed
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


@pytest.mark.parametrize("denied", [True, False])
def test_an_unanswered_reset_without_the_right_is_not_allowed(
    operator: Operator, monkeypatch: pytest.MonkeyPatch, denied: bool
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", not denied)
    for _ in range(DENIED_AFTER):
        operator.tell_contact()
        operator.ticks(1)
    operator.press("r")
    operator.ticks(1)
    operator.node.fake.answers[0][1](no_answer("safety"))
    reason = not_allowed("safety") if denied else no_answer("safety")
    assert operator.lines[-1] == f"reset refused: {reason}"


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
