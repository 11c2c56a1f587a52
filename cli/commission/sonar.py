"""Verdict on the sonars: each must detect a hand in front of it; a mix-up is named. Pure.

A sonar detects a hand if its range is clearly below its range at rest. The detection counts after
the same sonars have detected it for half a second, because a moving hand passes other sonars.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

from cli.commission.report import Row, Verdict, judged
from common.freshness import NS_PER_S
from common.messages import SONAR_NAMES, Ultrasonic

NEAR_M = 0.6  # a hand is held at 0.2 to 0.4 m
CLEARLY_M = 0.2  # below the range at rest: more than noise, less than the effect of a hand
HOLD_NS = NS_PER_S // 2
ROOM_M = NEAR_M + CLEARLY_M  # free space that the detection of a hand needs

Rest = tuple[float | None, ...]  # range at rest in m, None for a faulty sonar


@dataclass(frozen=True, slots=True)
class HandDetector:
    """Sonars that detect a hand, and since when."""

    rest: Rest
    seen: frozenset[str] = frozenset()
    since_ns: int = 0

    def take(self, sample: Ultrasonic, now_ns: int) -> "HandDetector":
        """Return the detector after one sample."""
        seen = near(sample, self.rest)
        return self if seen == self.seen else replace(self, seen=seen, since_ns=now_ns)

    def settled(self, now_ns: int) -> bool:
        """Return whether the same sonars have detected a hand for long enough."""
        return now_ns - self.since_ns >= HOLD_NS


@dataclass(frozen=True, slots=True)
class Finding:
    """Sonars that detected the hand in front of sonar ``name``, and the nearest reading, m."""

    name: str
    detected_by: tuple[str, ...]
    nearest: float | None = None


def resting_ranges(samples: Sequence[Ultrasonic]) -> Rest:
    """Return each sonar's range at rest; None if it is faulty in half of the samples."""
    return tuple(map(_middle, zip(*map(_distances, samples), strict=True)))


def near(sample: Ultrasonic, rest: Rest) -> frozenset[str]:
    """Return the sonars that detect a hand."""
    return frozenset(
        name
        for name, distance, resting in zip(SONAR_NAMES, _distances(sample), rest, strict=True)
        if distance is not None and resting is not None
        if distance < min(NEAR_M, resting - CLEARLY_M)
    )


def nearest(sample: Ultrasonic) -> float | None:
    """Return the nearest reading, m; None if every sonar is faulty."""
    return min((one for one in _distances(sample) if one is not None), default=None)


def words(name: str) -> str:
    """Return the name of a sonar as words."""
    return name.replace("_", " ")


def obstructions(rest: Rest) -> str:
    """Return a text that names sonars without free space; empty if all have it."""
    tight = [
        f"{words(name)} {distance:.2f} m"
        for name, distance in zip(SONAR_NAMES, rest, strict=True)
        if distance is not None and distance < ROOM_M
    ]
    return f"Clear {ROOM_M:g} m all around: {', '.join(tight)}." if tight else ""


def judge_sonars(rest: Rest, findings: Sequence[Finding]) -> Verdict:
    """Return the verdict on the findings of all sonars."""
    of_name = dict(zip(SONAR_NAMES, rest, strict=True))
    single = {each.name: each.detected_by[0] for each in findings if len(each.detected_by) == 1}
    problems = [*(_problem(each, of_name[each.name]) for each in findings), mixup(single)]
    data = [_row(each, of_name[each.name]) for each in findings]
    return judged(problems, "Each sonar is in its place.", data)


def mixup(detected: Mapping[str, str]) -> str:
    """Return a text that names the mix-up; maps the sonar with the hand to the detecting one."""
    wrong = {name: other for name, other in detected.items() if name != other}
    if not wrong:
        return ""
    pairs = [(SONAR_NAMES.index(name), SONAR_NAMES.index(to)) for name, to in detected.items()]
    for arrangement, sign, offset in _ARRANGEMENTS:
        if len(pairs) > 2 and all((sign * i + offset) % 8 == to for i, to in pairs):
            return f"{arrangement}: the order differs from the manual's."
    swaps = {frozenset(pair) for pair in wrong.items() if wrong.get(pair[1]) == pair[0]}
    exchanged = sorted(" and ".join(sorted(map(words, swap))) for swap in swaps)
    texts = [f"Exchanged: {each}." for each in exchanged] + [
        f"{words(name)} is reported as {words(other)}."
        for name, other in wrong.items()
        if frozenset((name, other)) not in swaps
    ]
    return " ".join(texts)


# A hand in front of sonar i is detected by (sign * i + offset) mod 8. Sonars are numbered clockwise
# from the left: 0 left, 2 front, 4 right, 6 rear.
_ARRANGEMENTS = (
    ("Left and right are exchanged", -1, 4),
    ("Front and rear are exchanged", -1, 0),
    ("Front and rear are exchanged, and left and right too", 1, 4),
    *((f"The ring is rotated by {n} places clockwise", 1, n) for n in (1, 2, 3, 5, 6, 7)),
)


def _problem(finding: Finding, resting: float | None) -> str:
    name = words(finding.name)
    if resting is None:
        return f"{name} is faulty: the board reports 0xFFFF."
    if not finding.detected_by:
        return f"{name}: no sonar detected the hand."
    if finding.detected_by == (finding.name,):
        return ""
    return f"{name}: the hand was detected by {' and '.join(map(words, finding.detected_by))}."


def _row(finding: Finding, resting: float | None) -> Row:
    names = ", ".join(map(words, finding.detected_by)) or "none"
    ranges = f"at {_metres(finding.nearest)}; at rest {_metres(resting)}"
    return f"hand in front of {words(finding.name)}", f"detected by {names}, {ranges}"


def _distances(sample: Ultrasonic) -> list[float | None]:
    other: dict[str, float] = {"too_near": 0.0, "no_echo": math.inf}
    pairs = zip(sample.ranges, sample.status, strict=True)
    return [known if status == "ok" else other.get(status) for known, status in pairs]


def _middle(column: Sequence[float | None]) -> float | None:
    known = [distance for distance in column if distance is not None]
    return median(known) if 2 * len(known) > len(column) else None


def _metres(distance: float | None) -> str:
    if distance is None:
        return "no reading"
    return "no echo" if math.isinf(distance) else f"{distance:.2f} m"
