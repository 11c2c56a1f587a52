"""One reset, from its request to the state that confirms it."""

import pytest

from common.freshness import NS_PER_S
from common.messages import ResetDone
from services.teleop.reset_check import ResetCheck
from tests.factories import contact_state, safety_state

SEEN = contact_state(boot=5)
DONE = ResetDone(text="Reset.", boot=5, heartbeat=9, cleared=(42,))
AFTER = safety_state(boot=5, heartbeat=9)


def test_before_the_answer_nothing_is_decided() -> None:
    check = ResetCheck(SEEN)
    assert not check.is_answered
    assert check.outcome(AFTER, 1 << 62) is None


@pytest.mark.parametrize(
    ("state", "confirmed"),
    [
        (AFTER, True),
        (safety_state(boot=5, heartbeat=8), False),  # from before the reset
        (safety_state(boot=6, heartbeat=9), False),  # another safety's
        (contact_state(boot=5, heartbeat=9), False),  # the cause is still there
        (None, False),
    ],
)
def test_only_safetys_own_state_confirms(state: object, confirmed: bool) -> None:
    check = ResetCheck(SEEN)
    check.answer(DONE)
    assert check.is_answered
    assert check.outcome(None, 10 * NS_PER_S) is None
    assert check.outcome(state, 11 * NS_PER_S) is (True if confirmed else None)  # type: ignore[arg-type]
    assert check.outcome(state, 11 * NS_PER_S + 1) is confirmed  # type: ignore[arg-type]


def test_an_answer_of_another_program_is_not_confirmed() -> None:
    check = ResetCheck(SEEN)
    check.answer(ResetDone(text="ok", boot=77, heartbeat=9, cleared=(42,)))
    assert check.outcome(AFTER, 10 * NS_PER_S) is None
    assert check.outcome(AFTER, 12 * NS_PER_S) is False
