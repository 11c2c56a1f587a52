"""The eight sonars in the streams: ranges, resolution, noise, wrong and missing readings. Pure."""

import math
from collections import Counter
from itertools import pairwise
from statistics import median, stdev

from msgspec import Struct

from cli.fit.estimate import Estimate
from cli.fit.steady import standstills
from cli.fit.streams import Streams, between
from t2.messages import SONAR_NAMES

STEP_M = 0.001  # of the ranges on the wire
JUMP_M = 0.3  # nearer than the readings before and after it
ENDS, ENDS_SHARE = 20, 0.01  # equal greatest readings, of two sonars: there the sonars end
SETTING = "vehicle.sonar_max"
AGREE_M = 0.02  # between the greatest readings of all sonars
DIFFERENT = 10  # readings that show a resolution
LEAST = 8  # readings of a standstill


class Ranges(Struct, frozen=True, kw_only=True):
    """What the sonars reported, all of them together."""

    readings: int
    faulty: float  # share of the readings
    no_echo: float  # share of the readings
    nearest: float  # m
    farthest: float  # m
    ends: Estimate | None  # m, the greatest readings of the sonars, if many are equal to it
    resolution: float  # m, of which all readings are multiples; 0.001 if there are few
    jumps: float  # share of the readings at standstill that were nearer by 0.3 m for one sample
    noise: Estimate | None  # m, at standstill


def ranges(streams: Streams) -> Ranges | None:
    """Return the ranges; None without any reading."""
    samples = streams.ultrasonics
    status = Counter(each for sample in samples for each in sample.status)
    found = [(n, r) for sample in samples for n, r in enumerate(sample.ranges) if r is not None]
    if not found:
        return None
    total, millimetres = status.total(), Counter(round(r / STEP_M) for _, r in found)
    jumps, noise, still = _at_standstill(streams)
    return Ranges(
        readings=total,
        faulty=status["fault"] / total,
        no_echo=status["no_echo"] / total,
        nearest=min(millimetres) * STEP_M,
        farthest=max(millimetres) * STEP_M,
        ends=_end(found),
        resolution=(math.gcd(*millimetres) if len(millimetres) >= DIFFERENT else 1) * STEP_M,
        jumps=jumps / still if still else 0.0,
        noise=noise,
    )


def _end(found: list[tuple[int, float]]) -> Estimate | None:
    """Return the greatest readings of the sonars that end there; None unless two agree."""
    ends = []
    for n in range(len(SONAR_NAMES)):
        millimetres = Counter(round(r / STEP_M) for sonar, r in found if sonar == n)
        farthest = max(millimetres, default=0)
        if millimetres[farthest] >= max(ENDS, ENDS_SHARE * millimetres.total()):
            ends.append(farthest * STEP_M)
    end = Estimate(
        name="sonars, greatest reading", unit="m", values=tuple(ends), resolution=STEP_M,
        setting=SETTING,
    )  # fmt: skip
    agree = bool(ends[1:]) and max(r for _, r in found) - min(ends) < AGREE_M
    return end if agree else None


def _at_standstill(streams: Streams) -> tuple[int, Estimate | None, int]:
    """Return single near readings, the noise, and the number of readings, at standstill."""
    jumps, still, noises = 0, 0, []
    for window in standstills(streams):
        samples = between(streams.ultrasonics, window.begin_ns, window.end_ns)
        for n in range(len(SONAR_NAMES)):
            readings = [r for sample in samples if (r := sample.ranges[n]) is not None]
            if len(readings) < LEAST:
                continue
            still += len(readings)
            usual = median(readings)
            kept = [r for r in readings if abs(r - usual) < JUMP_M]
            jumps += sum(before - r > JUMP_M for before, r in pairwise(readings))
            noises.append(stdev(kept))
    if not noises:
        return jumps, None, still
    noise = Estimate(name="sonars at standstill, noise", unit="m", values=tuple(noises))
    return jumps, noise, still
