"""Limits that end by themselves, and are confirmed by safety's state."""

from typing import Any

import numpy as np
import pytest

import t2
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed


def cap(robot: t2.Robot) -> float | None:
    """Return the cap that safety's state shows."""
    (limit,) = robot.safety.latest().limit_sources
    return limit.linear


def test_a_limit_is_shown_when_the_call_returns(robot: t2.Robot) -> None:
    limit = robot.limit("detector", linear=np.float64(0.3), seconds=np.float64(60.0))
    assert cap(robot) == 0.3
    limit.set(0.2, seconds=60)
    assert cap(robot) == 0.2
    limit.end()
    wait_until(lambda: cap(robot) is None, "the end of the limit")


def test_a_limit_needs_its_duration(robot: t2.Robot) -> None:
    call: Any = robot.limit
    with pytest.raises(TypeError, match="seconds"):
        call("detector", linear=0.3)


def test_a_limit_is_kept_when_its_replacement_is_invalid(robot: t2.Robot) -> None:
    limit = robot.limit("detector", linear=0.3, seconds=60)
    text: Any = "0.2"
    for error, linear, reason in ((TypeError, text, ""), (UnicodeError, 0.2, "\ud800")):
        with pytest.raises(error):
            limit.set(linear, reason=reason, seconds=60)
    ages = [robot.safety.latest().limit_sources[0].age or 0.0]
    wait_until(lambda: repeated(robot, ages), "a repetition")
    assert cap(robot) == 0.3
    limit.end()


def repeated(robot: t2.Robot, ages: list[float]) -> bool:
    """Return whether the limit has become younger."""
    ages.append(robot.safety.latest().limit_sources[0].age or 0.0)
    return ages[-1] < ages[-2]


def test_an_unexpected_error_ends_a_limit_and_frees_its_source(robot: t2.Robot) -> None:
    limit = robot.limit("detector", linear=0.3, seconds=60)
    limit._limit = None  # type: ignore[assignment]
    wait_until(lambda: limit.has_ended, "the end of the limit")
    with pytest.raises(t2.T2Error, match="has ended"):
        limit.set(0.2, seconds=60)
    robot.limit("detector", linear=0.2, seconds=60).end()
