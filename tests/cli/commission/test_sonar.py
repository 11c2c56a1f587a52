"""Hands in front of sonars: the right one, another one, two, none, faulty ones."""

import math

import pytest

from cli.commission.sonar import (
    HOLD_NS,
    HandDetector,
    Rest,
    judge_sonars,
    near,
    obstructions,
    resting_ranges,
)
from t2.messages import SONAR_NAMES, RangeStatus, Ultrasonic

FREE: Rest = (math.inf,) * 8


def sample(**values: float | RangeStatus) -> Ultrasonic:
    """Return eight sonars without an echo, except the given ones."""
    status: list[RangeStatus] = []
    ranges: list[float | None] = []
    for name in SONAR_NAMES:
        value = values.get(name, "no_echo")
        status.append("ok" if isinstance(value, float) else value)
        ranges.append(value if isinstance(value, float) else None)
    return Ultrasonic(ranges=tuple(ranges), status=tuple(status))


@pytest.mark.parametrize(
    ("value", "rest", "is_near"),
    [
        (0.59, math.inf, True),
        (0.6, math.inf, False),
        ("too_near", math.inf, True),
        ("fault", math.inf, False),
        (0.3, 0.5, False),
        (0.3, 0.51, True),
        (0.3, None, False),
    ],
)
def test_distance_of_a_hand(value: float | RangeStatus, rest: float | None, is_near: bool) -> None:
    resting = (math.inf, math.inf, rest, *FREE[3:])
    assert near(sample(front=value), resting) == ({"front"} if is_near else frozenset())


def test_range_at_rest_is_the_median() -> None:
    samples = [
        sample(front=2.0, rear="fault", left="fault"),
        sample(front=2.2, rear="fault", left=1.5),
        sample(front="no_echo", rear=1.0, left=1.5),
    ]
    rest = dict(zip(SONAR_NAMES, resting_ranges(samples), strict=True))
    assert (rest["front"], rest["rear"], rest["left"]) == (2.2, None, 1.5)
    assert rest["right"] == math.inf
    # faulty half of the time
    assert resting_ranges([sample(front="fault"), sample(front=1.0)])[2] is None


def test_obstructions() -> None:
    assert obstructions((None, 0.8, *FREE[2:])) == ""
    problem = "Clear 0.8 m all around: left 0.79 m, rear 0.20 m."
    assert obstructions((0.79, *FREE[1:6], 0.2, math.inf)) == problem


def test_a_hand_is_detected_after_a_time() -> None:
    detector = HandDetector(FREE, since_ns=0)
    detector.take(sample(left=0.3), 10)  # passing by
    detector.take(sample(front=0.3), 20)
    detector.take(sample(front=0.31), HOLD_NS)
    assert not detector.settled(19 + HOLD_NS)
    assert detector.settled(20 + HOLD_NS)
    assert detector.seen == {"front"}


def test_faulty_blind_wrong_and_double_detection() -> None:
    rest = (None, 1.5, *FREE[2:])
    seen = {name: [name] for name in SONAR_NAMES}
    seen |= {"left": [], "front_left": ["front_right"], "front": [], "rear": ["rear", "rear_left"]}
    verdict = judge_sonars(rest, list(seen.values()))
    assert verdict.outcome == "failed"
    assert verdict.text == (
        "left is faulty: the board reports 0xFFFF. "
        "front left: the hand was detected by front right. front: no sonar detected the hand. "
        "rear: the hand was detected by rear, rear left."
    )
    assert [row[1] for row in verdict.data[:2]] == [
        "detected by nothing; at rest no reading", "detected by front right; at rest 1.50 m",
    ]  # fmt: skip


def test_a_step_that_is_left_judges_the_sonars_before() -> None:
    found = judge_sonars(FREE, [["left"], []], "the hand does not reach it")
    assert found.outcome == "failed"
    assert found.text == (
        "front left: no sonar detected the hand. Left after 2 of 8 sonars: the hand does not reach "
        "it."
    )
    assert len(found.data) == 2
