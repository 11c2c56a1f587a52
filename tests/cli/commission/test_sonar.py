"""Hands before sonars: the right one, the wrong one, two at once, none, dead ones."""

import math
from collections.abc import Mapping

import pytest

from cli.commission.sonar import (
    HOLD_NS,
    Finding,
    Rest,
    Watch,
    at_rest,
    crowded,
    judge_sonars,
    mixup,
    near,
    nearest,
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


def sample(**seen: float | RangeStatus) -> Ultrasonic:
    """Return eight sonars without an echo, but for these."""
    status: list[RangeStatus] = []
    ranges: list[float | None] = []
    for name in SONAR_NAMES:
        value = seen.get(name, "no_echo")
        status.append("ok" if isinstance(value, float) else value)
        ranges.append(value if isinstance(value, float) else None)
    return Ultrasonic(ranges=tuple(ranges), status=tuple(status))


def turned(places: int) -> dict[str, str]:
    return {name: SONAR_NAMES[(i + places) % 8] for i, name in enumerate(SONAR_NAMES)}


def findings(answered: Mapping[str, str]) -> list[Finding]:
    return [Finding(name, (to,), 0.3) for name, to in answered.items()]


RIGHT = turned(0)


# --- what is near ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "is_near"),
    [(0.59, True), (0.6, False), ("too_near", True), ("fault", False), ("no_echo", False)],
)
def test_near_is_a_hand_s_distance(value: float | RangeStatus, is_near: bool) -> None:
    assert near(sample(front=value), FREE) == ({"front"} if is_near else frozenset())


@pytest.mark.parametrize(("rest", "is_near"), [(0.5, False), (0.51, True), (None, False)])
def test_near_is_clearly_nearer_than_at_rest(rest: float | None, is_near: bool) -> None:
    whole = (math.inf, math.inf, rest, *FREE[3:])
    assert bool(near(sample(front=0.3), whole)) is is_near


def test_rest_is_the_median_and_a_sonar_that_is_mostly_faulty_is_faulty() -> None:
    samples = [
        sample(front=2.0, rear="fault", left="fault"),
        sample(front=2.2, rear="fault", left=1.5),
        sample(front="no_echo", rear=1.0, left=1.5),
    ]
    rest = dict(zip(SONAR_NAMES, at_rest(samples), strict=True))
    assert (rest["front"], rest["rear"], rest["left"]) == (2.2, None, 1.5)
    assert rest["right"] == math.inf


def test_a_sonar_that_is_faulty_half_the_time_is_faulty() -> None:
    assert at_rest([sample(front="fault"), sample(front=1.0)])[2] is None


def test_there_must_be_room_for_a_hand() -> None:
    assert crowded(FREE) == ""
    assert crowded((None, *FREE[1:])) == ""
    assert crowded((0.8, *FREE[1:])) == ""
    assert crowded((0.79, *FREE[1:6], 0.2, math.inf)) == (
        "Make room, 0.8 m all around: left 0.79 m, rear 0.20 m."
    )


def test_the_nearest_reading() -> None:
    assert nearest(sample(front=0.4, rear=0.3, left="fault")) == 0.3
    assert nearest(sample(front="too_near")) == 0.0
    assert nearest(Ultrasonic(ranges=(None,) * 8, status=("fault",) * 8)) is None


def test_a_hand_counts_once_it_is_held() -> None:
    watch = Watch(FREE, since_ns=0).take(sample(left=0.3), 10)  # on its way
    watch = watch.take(sample(front=0.3), 20)
    watch = watch.take(sample(front=0.31), HOLD_NS)
    assert not watch.settled(19 + HOLD_NS)
    assert watch.settled(20 + HOLD_NS)
    assert watch.seen == {"front"}


# --- the verdict ----------------------------------------------------------------------------------


def test_each_in_its_place_passes() -> None:
    verdict = judge_sonars(FREE, findings(RIGHT))
    assert (verdict.outcome, verdict.text) == ("passed", "Each sonar answers in its place.")
    assert verdict.data[0] == ("hand before left", "seen by left, at 0.30 m; at rest no echo")


def test_a_dead_one_a_deaf_one_and_a_double_one_are_told_apart() -> None:
    rest = (None, *FREE[1:])
    seen = [Finding("left", ()), Finding("front", ()), Finding("rear", ("rear", "rear_left"), 0.2)]
    verdict = judge_sonars(rest, seen)
    assert verdict.outcome == "failed"
    assert verdict.text == (
        "left is faulty: the board reports 0xFFFF. front: no sonar saw the hand. "
        "rear: the hand was seen by rear and rear left."
    )
    assert verdict.data[0] == (
        "hand before left",
        "seen by none, at no reading; at rest no reading",
    )


def test_a_mixup_is_named_beside_what_is_wrong_with_each() -> None:
    verdict = judge_sonars(FREE, findings(MIRROR))
    assert verdict.outcome == "failed"
    assert "left: the hand was seen by right." in verdict.text
    assert verdict.text.endswith("Left and right are exchanged: the order is not the manual's.")


@pytest.mark.parametrize(
    ("answered", "said"),
    [
        (RIGHT, ""),
        ({}, ""),
        (MIRROR, "Left and right are exchanged: the order is not the manual's."),
        (TURNOVER, "Front and rear are exchanged: the order is not the manual's."),
        (
            turned(4),
            "Front and rear are exchanged, and left and right too: the order is not the manual's.",
        ),
        (turned(1), "The ring is turned by 1 places clockwise: the order is not the manual's."),
        (turned(7), "The ring is turned by 7 places clockwise: the order is not the manual's."),
        (RIGHT | FRONT_REAR, "Exchanged: front and rear."),
        (RIGHT | LEFT_RIGHT, "Exchanged: left and right."),
        (RIGHT | {"front": "front_left"}, "front comes as front left."),
        ({"left": "right"}, "left comes as right."),  # one alone shows no arrangement
        (
            RIGHT | FRONT_REAR | LEFT_RIGHT | {"rear_left": "left"},
            "Exchanged: front and rear. Exchanged: left and right. rear left comes as left.",
        ),
    ],
)  # fmt: skip
def test_mixups_have_names(answered: dict[str, str], said: str) -> None:
    assert mixup(answered) == said
