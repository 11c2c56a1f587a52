"""Which sonar answers to a hand, one after the other, and what a mix-up is called.

A hand is seen by the sonars that became clearly nearer than they were at rest. It counts once the
same ones have seen it for half a second: on the way to its place it passes others.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

from cli.commission.verdict import Row, Verdict, judged
from common.freshness import NS_PER_S
from common.messages import SONAR_NAMES, Ultrasonic

NEAR_M = 0.6  # a hand is held at 0.2 to 0.4 m
CLEARLY_M = 0.2  # nearer than at rest: more than noise, less than a hand makes
HOLD_NS = NS_PER_S // 2
ROOM_M = NEAR_M + CLEARLY_M  # what must be free before a sonar, or a hand could not be told

Rest = tuple[float | None, ...]  # m at rest, None for a faulty sonar


@dataclass(frozen=True, slots=True)
class Watch:
    """Waits until the same sonars have seen something for half a second."""

    rest: Rest
    seen: frozenset[str] = frozenset()
    since_ns: int = 0

    def take(self, sample: Ultrasonic, now_ns: int) -> "Watch":
        """Return the watch after one sample."""
        seen = near(sample, self.rest)
        return self if seen == self.seen else replace(self, seen=seen, since_ns=now_ns)

    def settled(self, now_ns: int) -> bool:
        """Tell whether what is seen has been so for long enough."""
        return now_ns - self.since_ns >= HOLD_NS


@dataclass(frozen=True, slots=True)
class Finding:
    """Which sonars answered to a hand before this one, and how near the nearest came, in m."""

    name: str
    answered: tuple[str, ...]
    nearest: float | None = None


def at_rest(samples: Sequence[Ultrasonic]) -> Rest:
    """Return what each sonar sees by itself; a sonar that is faulty half the time is faulty."""
    columns = zip(*([_distance(one, i) for i in range(8)] for one in samples), strict=True)
    return tuple(_middle(column) for column in columns)


def near(sample: Ultrasonic, rest: Rest) -> frozenset[str]:
    """Return the names of the sonars that something was put before."""
    return frozenset(
        name for i, name in enumerate(SONAR_NAMES) if _is_near(_distance(sample, i), rest[i])
    )


def nearest(sample: Ultrasonic) -> float | None:
    """Return the nearest reading, in m; None when every sonar is faulty."""
    distances = [_distance(sample, i) for i in range(8)]
    return min((one for one in distances if one is not None), default=None)


def crowded(rest: Rest) -> str:
    """Say what stands too near for a hand to be told from it; empty when there is room."""
    tight = [
        f"{_words(name)} {distance:.2f} m"
        for name, distance in zip(SONAR_NAMES, rest, strict=True)
        if distance is not None and distance < ROOM_M
    ]
    return f"Make room, {ROOM_M:g} m all around: {', '.join(tight)}." if tight else ""


def judge_sonars(rest: Rest, findings: Sequence[Finding]) -> Verdict:
    """Judge by what answered at each sonar's turn."""
    of_name = dict(zip(SONAR_NAMES, rest, strict=True))
    problems = [*_singly(of_name, findings), mixup(_one_for_one(findings))]
    return judged(problems, "Each sonar answers in its place.", _data(of_name, findings))


def mixup(answered: Mapping[str, str]) -> str:
    """Name the mix-up in what answered (values) to a hand before which sonar (keys)."""
    wrong = {name: other for name, other in answered.items() if name != other}
    if not wrong:
        return ""
    pairs = [(SONAR_NAMES.index(name), SONAR_NAMES.index(to)) for name, to in answered.items()]
    for words, sign, offset in _ARRANGEMENTS:
        if len(pairs) > 2 and all((sign * i + offset) % 8 == to for i, to in pairs):
            return f"{words}: the order is not the manual's."
    swaps = {frozenset(pair) for pair in wrong.items() if wrong.get(pair[1]) == pair[0]}
    named = [" and ".join(sorted(map(_words, swap))) for swap in swaps]
    single = [
        f"{_words(name)} comes as {_words(other)}"
        for name, other in wrong.items()
        if frozenset((name, other)) not in swaps
    ]
    return " ".join(
        [*(f"Exchanged: {each}." for each in sorted(named)), *(f"{s}." for s in single)]
    )


# What answers to a hand before number i of the ring: (sign * i + offset) mod 8. The ring is counted
# clockwise from the left: 0 left, 2 front, 4 right, 6 rear.
_ARRANGEMENTS = (
    ("Left and right are exchanged", -1, 4),
    ("Front and rear are exchanged", -1, 0),
    ("Front and rear are exchanged, and left and right too", 1, 4),
    *((f"The ring is turned by {n} places clockwise", 1, n) for n in (1, 2, 3, 5, 6, 7)),
)


def _singly(rest: Mapping[str, float | None], findings: Sequence[Finding]) -> Iterator[str]:
    for finding in findings:
        name = _words(finding.name)
        if rest[finding.name] is None:
            yield f"{name} is faulty: the board reports 0xFFFF."
        elif not finding.answered:
            yield f"{name}: no sonar saw the hand."
        elif finding.answered != (finding.name,):
            yield f"{name}: the hand was seen by {' and '.join(map(_words, finding.answered))}."


def _one_for_one(findings: Sequence[Finding]) -> dict[str, str]:
    return {each.name: each.answered[0] for each in findings if len(each.answered) == 1}


def _data(rest: Mapping[str, float | None], findings: Sequence[Finding]) -> Iterator[Row]:
    for finding in findings:
        seen = ", ".join(map(_words, finding.answered)) or "none"
        yield (
            f"hand before {_words(finding.name)}",
            f"seen by {seen}, at {_metres(finding.nearest)}; at rest {_metres(rest[finding.name])}",
        )


def _distance(sample: Ultrasonic, index: int) -> float | None:
    status = sample.status[index]
    if status == "ok":
        return sample.ranges[index]
    return {"too_near": 0.0, "no_echo": math.inf}.get(status)


def _middle(column: Sequence[float | None]) -> float | None:
    known = [distance for distance in column if distance is not None]
    return median(known) if 2 * len(known) > len(column) else None


def _is_near(distance: float | None, rest: float | None) -> bool:
    if distance is None or rest is None:
        return False
    return distance < NEAR_M and distance < rest - CLEARLY_M


def _metres(distance: float | None) -> str:
    if distance is None:
        return "no reading"
    return "no echo" if math.isinf(distance) else f"{distance:.2f} m"


def _words(name: str) -> str:
    return name.replace("_", " ")
