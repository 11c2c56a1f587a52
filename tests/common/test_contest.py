"""When an operator is overruled by another source."""

import pytest

from common.messages import SafetyState
from common.operator import OVERRULED_TICKS, Contest
from tests.factories import safety_state


def driven_by(source: str | None) -> SafetyState:
    return safety_state(source=source)


def test_an_operator_is_overruled_after_half_a_second_of_requests() -> None:
    contest = Contest("web")
    for count in range(OVERRULED_TICKS):
        assert (contest.ticks, contest.is_lost) == (count, False)
        contest.tick(driven_by("teleop"), requests=True)
    assert contest.is_lost
    assert contest.other == "teleop"
    contest.tick(driven_by("teleop"), requests=False)
    assert (contest.other, contest.ticks) == ("teleop", 0)


@pytest.mark.parametrize("source", [None, "web"])
def test_no_other_source_overrules(source: str | None) -> None:
    contest = Contest("web")
    contest.tick(driven_by("nav"), requests=True)
    contest.tick(driven_by(source), requests=True)
    assert (contest.other, contest.ticks) == (None, 0)


def test_without_a_state_nobody_is_overruled() -> None:
    contest = Contest("web", "nav", OVERRULED_TICKS)
    contest.tick(None, requests=True)
    assert (contest.other, contest.ticks) == (None, 0)
