"""Verdict on the sonars: each must detect a hand in front of it, and no other one. Pure.

A sonar detects a hand if its range is clearly below its range at rest. The detection counts after
the same sonars have detected it for half a second, because a moving hand passes other sonars.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from cli.commission.report import Verdict, judged
from cli.commission.texts import ENGLISH, Say
from common.freshness import NS_PER_S
from t2.messages import SONAR_NAMES, Ultrasonic

NEAR_M = 0.6  # a hand is held at 0.2 to 0.4 m
CLEARLY_M = 0.2  # below the range at rest: more than noise, less than the effect of a hand
HOLD_NS = NS_PER_S // 2
ROOM_M = NEAR_M + CLEARLY_M  # free space that the detection of a hand needs
OTHER = {"too_near": 0.0, "no_echo": math.inf}  # range by status; a faulty sonar has none

Rest = tuple[float | None, ...]  # range at rest in m, None for a faulty sonar


@dataclass(slots=True)
class HandDetector:
    """Sonars that detect a hand, and since when."""

    rest: Rest
    since_ns: int
    seen: frozenset[str] = frozenset()

    def take(self, sample: Ultrasonic, now_ns: int) -> None:
        """Take the next sample."""
        before, self.seen = self.seen, near(sample, self.rest)
        if self.seen != before:
            self.since_ns = now_ns

    def settled(self, now_ns: int) -> bool:
        """Return whether the same sonars have detected a hand for long enough."""
        return now_ns - self.since_ns >= HOLD_NS


def resting_ranges(samples: Sequence[Ultrasonic]) -> Rest:
    """Return each sonar's range at rest; None if it is faulty in half of the samples."""
    rest: list[float | None] = []
    for column in zip(*map(_distances, samples), strict=True):
        known = [distance for distance in column if distance is not None]
        rest.append(median(known) if 2 * len(known) > len(column) else None)
    return tuple(rest)


def near(sample: Ultrasonic, rest: Rest) -> frozenset[str]:
    """Return the sonars that detect a hand."""
    return frozenset(
        name
        for name, distance, resting in zip(SONAR_NAMES, _distances(sample), rest, strict=True)
        if distance is not None and resting is not None
        if distance < min(NEAR_M, resting - CLEARLY_M)
    )


def obstructions(rest: Rest, say: Say = ENGLISH) -> str:
    """Return a text that names sonars without free space; empty if all have it."""
    tight = [
        say("sonar.reading", sonar=name, distance=distance)
        for name, distance in zip(SONAR_NAMES, rest, strict=True)
        if distance is not None and distance < ROOM_M
    ]
    return say("sonar.clear", room=ROOM_M, tight=tuple(tight)) if tight else ""


def judge_sonars(
    rest: Rest, found: Sequence[Sequence[str]], left: str = "", say: Say = ENGLISH
) -> Verdict:
    """Return the verdict; ``found`` are the sonars that detected the hand before each sonar.

    ``left`` is why the operator has left the step before the last sonar.
    """
    problems, data = [], []
    for name, resting, detected_by in zip(SONAR_NAMES, rest, found, strict=False):
        problems.append(_problem(name, resting, detected_by, say))
        at_rest = say("no_reading") if resting is None else f"{resting:.2f} m"
        shown = at_rest.replace("inf m", say("no_echo"))
        names = tuple(detected_by) or say("nothing")
        detected = say("figure.detected", sonars=names, rest=shown)
        data.append((say("figure.hand", sonar=name), detected))
    if left:
        count = {"done": len(found), "all": len(SONAR_NAMES)}
        problems.append(say("sonar.left", **count, reason=left))
    return judged(problems, say("sonar.good"), data, say)


def _problem(name: str, resting: float | None, detected_by: Sequence[str], say: Say) -> str:
    if resting is None:
        return say("sonar.fault", sonar=name)
    if not detected_by:
        return say("sonar.missed", sonar=name)
    if list(detected_by) == [name]:
        return ""
    return say("sonar.other", sonar=name, sonars=tuple(detected_by))


def _distances(sample: Ultrasonic) -> list[float | None]:
    pairs = zip(sample.ranges, sample.status, strict=True)
    return [known if status == "ok" else OTHER.get(status) for known, status in pairs]
