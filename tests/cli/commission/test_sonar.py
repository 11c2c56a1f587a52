"""Hands in front of sonars: the right one, another one, two, none, faulty ones."""

import math
from collections.abc import Mapping

import pytest

from cli.commission.sonar import (
    HOLD_NS,
    Finding,
    HandDetector,
    Rest,
    judge_sonars,
    mixup,
    near,
    nearest,
    obstructions,
    resting_ranges,
)
from common.messages import SONAR_NAMES, RangeStatus, Ultrasonic

FREE: Rest = (math.inf,) * 8
MIRROR = {
    "left": "right", "front_left": "front_right", "front": "front", "front_right": "front_left",
    "right": "left", "rear_right": "rear_left", "rear": "rear", "rear_left": "rear_right",
}  # fmt: skip
TURNOVER = {
    "left": "left", "front_left": "rear_left", "front": "rear", "front_right": "rear_right",
    "right": "right", "rear_right": "front_right", "rear": "front", "rear_left": "front_left",
}  # fmt: skip

FRONT_REAR = {"front": "rear", "rear": "front"}
LEFT_RIGHT = {"left": "right", "right": "left"}


def sample(**values: float | RangeStatus) -> Ultrasonic:
    """Return eight sonars without an echo, except the given ones."""
    status: list[RangeStatus] = []
    ranges: list[float | None] = []
    for name in SONAR_NAMES:
        value = values.get(name, "no_echo")
        status.append("ok" if isinstance(value, float) else value)
        ranges.append(value if isinstance(value, float) else None)
    return Ultrasonic(ranges=tuple(ranges), status=tuple(status))


def turned(places: int) -> dict[str, str]:
    return {name: SONAR_NAMES[(i + places) % 8] for i, name in enumerate(SONAR_NAMES)}


def findings(detected: Mapping[str, str]) -> list[Finding]:
    return [Finding(name, (to,), 0.3) for name, to in detected.items()]


RIGHT = turned(0)
DIFFERS = "the order differs from the manual's."


# --- detection ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "is_near"),
    [(0.59, True), (0.6, False), ("too_near", True), ("fault", False), ("no_echo", False)],
)
def test_distance_of_a_hand(value: float | RangeStatus, is_near: bool) -> None:
    assert near(sample(front=value), FREE) == ({"front"} if is_near else frozenset())


@pytest.mark.parametrize(("rest", "is_near"), [(0.5, False), (0.51, True), (None, False)])
def test_distance_below_the_range_at_rest(rest: float | None, is_near: bool) -> None:
    whole = (math.inf, math.inf, rest, *FREE[3:])
    assert bool(near(sample(front=0.3), whole)) is is_near


def test_range_at_rest_is_the_median() -> None:
    samples = [
        sample(front=2.0, rear="fault", left="fault"),
        sample(front=2.2, rear="fault", left=1.5),
        sample(front="no_echo", rear=1.0, left=1.5),
    ]
    rest = dict(zip(SONAR_NAMES, resting_ranges(samples), strict=True))
    assert (rest["front"], rest["rear"], rest["left"]) == (2.2, None, 1.5)
    assert rest["right"] == math.inf


def test_a_sonar_that_is_faulty_half_the_time_is_faulty() -> None:
    assert resting_ranges([sample(front="fault"), sample(front=1.0)])[2] is None


def test_obstructions() -> None:
    assert obstructions(FREE) == ""
    assert obstructions((None, *FREE[1:])) == ""
    assert obstructions((0.8, *FREE[1:])) == ""
    assert obstructions((0.79, *FREE[1:6], 0.2, math.inf)) == (
        "Clear 0.8 m all around: left 0.79 m, rear 0.20 m."
    )


def test_the_nearest_reading() -> None:
    assert nearest(sample(front=0.4, rear=0.3, left="fault")) == 0.3
    assert nearest(sample(front="too_near")) == 0.0
    assert nearest(Ultrasonic(ranges=(None,) * 8, status=("fault",) * 8)) is None


def test_a_hand_is_detected_after_a_time() -> None:
    detector = HandDetector(FREE, since_ns=0).take(sample(left=0.3), 10)  # passing by
    detector = detector.take(sample(front=0.3), 20)
    detector = detector.take(sample(front=0.31), HOLD_NS)
    assert not detector.settled(19 + HOLD_NS)
    assert detector.settled(20 + HOLD_NS)
    assert detector.seen == {"front"}


# --- the verdict ----------------------------------------------------------------------------------


def test_each_in_its_place_passes() -> None:
    verdict = judge_sonars(FREE, findings(RIGHT))
    assert (verdict.outcome, verdict.text) == ("passed", "Each sonar is in its place.")
    assert verdict.data[0] == (
        "hand in front of left",
        "detected by left, at 0.30 m; at rest no echo",
    )


def test_faulty_blind_and_double_detection() -> None:
    rest = (None, *FREE[1:])
    seen = [Finding("left", ()), Finding("front", ()), Finding("rear", ("rear", "rear_left"), 0.2)]
    verdict = judge_sonars(rest, seen)
    assert verdict.outcome == "failed"
    assert verdict.text == (
        "left is faulty: the board reports 0xFFFF. front: no sonar detected the hand. "
        "rear: the hand was detected by rear and rear left."
    )
    assert verdict.data[0] == (
        "hand in front of left",
        "detected by none, at no reading; at rest no reading",
    )


def test_a_mixup_is_named_with_the_problems_of_each_sonar() -> None:
    verdict = judge_sonars(FREE, findings(MIRROR))
    assert verdict.outcome == "failed"
    assert "left: the hand was detected by right." in verdict.text
    assert verdict.text.endswith(f"Left and right are exchanged: {DIFFERS}")


@pytest.mark.parametrize(
    ("detected", "text"),
    [
        (RIGHT, ""),
        ({}, ""),
        (MIRROR, f"Left and right are exchanged: {DIFFERS}"),
        (TURNOVER, f"Front and rear are exchanged: {DIFFERS}"),
        (
            turned(4),
            f"Front and rear are exchanged, and left and right too: {DIFFERS}",
        ),
        (turned(1), f"The ring is rotated by 1 places clockwise: {DIFFERS}"),
        (turned(7), f"The ring is rotated by 7 places clockwise: {DIFFERS}"),
        (RIGHT | FRONT_REAR, "Exchanged: front and rear."),
        (RIGHT | LEFT_RIGHT, "Exchanged: left and right."),
        (RIGHT | {"front": "front_left"}, "front is reported as front left."),
        ({"left": "right"}, "left is reported as right."),  # one alone shows no arrangement
        (
            RIGHT | FRONT_REAR | LEFT_RIGHT | {"rear_left": "left"},
            "Exchanged: front and rear. Exchanged: left and right. rear left is reported as left.",
        ),
    ],
)  # fmt: skip
def test_mixups_have_names(detected: dict[str, str], text: str) -> None:
    assert mixup(detected) == text
