"""Fit of the stopping distance from measured stops, and the settings of safety for it. Pure.

Safety reckons with v * t_react + v^2 / (2 a). For each kind and direction the stops have a mean
reaction time and a mean slowness 1 / a, in which the distance is linear. Both have bounds by
Student's t, which widen with few stops; a bootstrap of 5 stops is too narrow:

- for the means, two-sided: what is known about the vehicle
- for the *next* stop, one-sided: what safety must expect

Each pair of bounds holds for reaction time and deceleration together with 95 % (Bonferroni: 97.5 %
for each). The resolution of the measurement widens all bounds. The proposal takes the worst group.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist, mean, stdev

from cli.commission.stops import Kind, Stop
from common.messages import Direction
from services.safety.config import Safety
from services.safety.core.release import stopping_distance

MEAN, NEXT = 0.9875, 0.975  # quantiles: 97.5 % two-sided, 97.5 % one-sided
FEWEST = 5  # stops of one kind and direction
SPREAD = 2.0  # between the fastest and the slowest stop
FASTEST = 0.8  # of safety.max_linear; the fit is not extrapolated further
VELOCITY_STEP = 0.001  # m/s
NO_BOUND = 1000.0  # m/s^2, in place of an upper bound of the deceleration
DIGITS = 6  # in 0.01; less is rounding of floats
SPEEDS = 10  # at which two settings are compared, up to safety.max_linear
REQUIRED: tuple[tuple[Kind, Direction], ...] = (("stop", "forward"), ("stop", "backward"))

Group = tuple[Kind, Direction]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean with its interval, and the bounds of the next stop on either side."""

    mean: float
    low: float
    high: float
    next_low: float
    next_high: float


@dataclass(frozen=True, slots=True)
class Fit:
    """The stops of one kind and direction."""

    stops: int
    slowest: float  # m/s
    fastest: float  # m/s
    reaction: Estimate  # s
    deceleration: Estimate  # m/s^2


@dataclass(frozen=True, slots=True)
class Settings:
    """What safety reckons with: s, m/s^2, m."""

    react: float
    deceleration: float
    margin: float

    def reckoned(self, speed: float) -> float:
        """Return the stopping distance (m) from this speed."""
        return stopping_distance(speed, self.react, self.deceleration)

    def room(self, speed: float) -> float:
        """Return the distance (m) at which this speed is allowed."""
        return self.margin + self.reckoned(speed)


def present_settings(safety: Safety) -> Settings:
    """Return the settings that safety has."""
    return Settings(safety.reaction, safety.deceleration, safety.margin)


def student(confidence: float, freedom: int) -> float:
    """Return a quantile of Student's t, for 4 degrees of freedom or more to 0.2 %.

    Abramowitz and Stegun, *Handbook of Mathematical Functions*, 26.7.5.
    """
    z = NormalDist().inv_cdf(confidence)
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return z + math.fsum(term / freedom**power for power, term in enumerate(terms, 1))


def estimate(values: Sequence[float], resolution: float) -> Estimate:
    """Return the estimate from at least ``FEWEST`` values."""
    middle, count = mean(values), len(values)
    spread = stdev(values)
    known = student(MEAN, count - 1) * spread / math.sqrt(count) + resolution
    expected = student(NEXT, count - 1) * spread * math.sqrt(1 + 1 / count) + resolution
    return Estimate(middle, middle - known, middle + known, middle - expected, middle + expected)


def fits(stops: Sequence[Stop], period_s: float) -> dict[Group, Fit]:
    """Return the fit of each kind and direction with enough stops; ``period_s``: of velocities."""
    return {
        group: _fit(found, period_s)
        for group, found in _groups(stops).items()
        if len(found) >= FEWEST
    }


def missing(stops: Sequence[Stop], max_linear: float) -> Iterator[str]:
    """Yield what must be recorded before settings can be proposed."""
    groups = _groups(stops)
    for group in dict.fromkeys([*REQUIRED, *groups]):
        name, found = label(group), groups.get(group, [])
        if len(found) < FEWEST:
            if group in REQUIRED:
                yield f"{FEWEST - len(found)} more {name}"
            continue
        slowest, fastest = min(s.speed for s in found), max(s.speed for s in found)
        if fastest < FASTEST * max_linear:
            yield (
                f"{name} from at least {FASTEST * max_linear:.2f} m/s (the fastest is "
                f"{fastest:.2f} m/s), or a lower safety.max_linear"
            )
        if fastest < SPREAD * slowest:
            yield f"{name} from at most {fastest / SPREAD:.2f} m/s"


def propose(
    found: Mapping[Group, Fit], stops: Sequence[Stop], margin: float, sensing_s: float
) -> Settings | str:
    """Return settings that fit all groups, rounded to the safe side, or why there are none.

    ``margin`` (m) is the present one. ``sensing_s`` is the age of a reading at the command:
    safety's reaction time begins there.
    """
    slowest_reaction = max(fit.reaction.next_high for fit in found.values())
    weakest = min(fit.deceleration.next_low for fit in found.values())
    least, most = Safety.protective["deceleration"]
    deceleration = min(most, _down(weakest))
    if deceleration < least:
        return (
            f"the next stop may decelerate with {weakest:.2f} m/s2 only, and safety accepts "
            f"{least:g} m/s2 or more: check the brakes, and record more stops"
        )
    react = max(Safety.protective["react"][0], _up(slowest_reaction + sensing_s))
    over = max(s.distance - stopping_distance(s.speed, react, deceleration) for s in stops)
    return Settings(react, deceleration, _up(margin + max(0.0, over)))


def too_long(stops: Sequence[Stop], present: Settings) -> list[int]:
    """Return the stops that were longer than these settings reckon with, by index."""
    return [n for n, stop in enumerate(stops) if stop.distance > present.reckoned(stop.speed)]


def shortfall(present: Settings, proposed: Settings, max_linear: float) -> tuple[float, float]:
    """Return the speed at which the present settings keep the least room, and by how much less.

    Speed in m/s, room in m; it is negative if they keep more than proposed at each speed.
    """
    speeds = [max_linear * step / SPEEDS for step in range(1, SPEEDS + 1)]
    lacking, speed = max((proposed.room(v) - present.room(v), v) for v in speeds)
    return speed, lacking


def label(group: Group) -> str:
    """Return the name of a kind and direction, such as "STOP forward"."""
    return f"{group[0].upper()} {group[1]}"


def _groups(stops: Sequence[Stop]) -> dict[Group, list[Stop]]:
    found: dict[Group, list[Stop]] = {}
    for stop in stops:
        found.setdefault((stop.kind, stop.direction), []).append(stop)
    return found


def _fit(stops: Sequence[Stop], period_s: float) -> Fit:
    # One step of the velocity over the slope, in the worst stop.
    step = VELOCITY_STEP * max(1 / (stop.deceleration * stop.speed) for stop in stops)
    return Fit(
        stops=len(stops),
        slowest=min(stop.speed for stop in stops),
        fastest=max(stop.speed for stop in stops),
        reaction=estimate([stop.reaction for stop in stops], period_s),
        deceleration=_inverse(estimate([1 / stop.deceleration for stop in stops], step)),
    )


def _inverse(slowness: Estimate) -> Estimate:
    """Return the estimate of a deceleration."""
    one = slowness
    low, high, next_low, next_high = (
        1 / max(value, 1 / NO_BOUND) for value in (one.high, one.low, one.next_high, one.next_low)
    )
    return Estimate(1 / one.mean, low, high, next_low, next_high)


def _up(value: float) -> float:
    return math.ceil(round(value * 100, DIGITS)) / 100


def _down(value: float) -> float:
    return math.floor(round(value * 100, DIGITS)) / 100
