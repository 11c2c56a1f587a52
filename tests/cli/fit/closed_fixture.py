"""A closed drive, as recorded messages: a square whose true path ends exactly where it began."""

import math
import random
from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from services.odom.config import Odom
from services.odom.core.estimator import Estimator
from t2.messages import Command, Mileage, Motion, Velocity

SIDE_M, SIDE_S, CORNER_S, REST_S = 5.0, 10.0, 3.0, 1.5
TRUE = Odom()


def steps(turns: int, period_s: float) -> Iterator[tuple[float, float]]:
    """Yield m and rad of each period: rest, four sides and corners, rest."""
    rest = [(0.0, 0.0)] * round(REST_S / period_s)
    side, corner = round(SIDE_S / period_s), round(CORNER_S / period_s)
    yield from rest
    for _ in range(4):
        yield from [(SIDE_M / side, 0.0)] * side
        yield from [(0.0, turns * math.pi / 2 / corner)] * corner
    yield from rest


def closed_streams(
    seed: int,
    *,
    noise: Odom = TRUE,
    begin_s: float = 10.0,
    period_s: float = 0.1,
) -> Streams:
    """Return a drive whose counters are random walks by ``noise``."""
    chance, made, estimator = random.Random(seed), Streams(), Estimator(TRUE)
    distance = heading = 0.0
    for number, (way, turn) in enumerate(steps(1 if seed % 2 else -1, period_s)):
        now_ns = round((begin_s + number * period_s) * NS_PER_S)
        header: dict[str, Any] = {"boot": 3, "host": 1, "seq": number, "mono_ns": now_ns}
        distance += way + chance.gauss(0, noise.distance_noise * math.sqrt(way))
        heading += turn + chance.gauss(0, noise.turn_noise * math.sqrt(abs(turn)))
        heading = math.remainder(heading + chance.gauss(0, noise.drift_noise * way**0.5), math.tau)
        velocity = Velocity(linear=way / period_s, angular=turn / period_s, **header)
        mileage = Mileage(distance=distance, heading=heading, epoch=0, **header)
        made.add(velocity)
        made.add(mileage)
        made.add(Motion(command=Command.STOP, **header))
        estimator.on_velocity(velocity, now_ns)
        estimator.on_mileage(mileage, now_ns)
        if found := estimator.estimate(now_ns):
            made.add(replace(found, **header))
    return made
