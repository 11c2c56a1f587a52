"""One vehicle with one source of fixes, in simulated time, and what its pose is worth."""

import math
import random
from typing import Any

import numpy as np
from msgspec import Struct

from services.localization.config import FixSource as SourceSettings
from services.localization.config import Localization, LocalizationConfig
from services.localization.localization import LocalizationService
from sim import requests as q
from t2 import keys
from t2 import messages as m
from verification.localization.source import SOURCE, FixModel, FixSource, place_request
from verification.search.bus import MS
from verification.search.draw import TURN_BRAKING, draw
from verification.search.judge import normalised
from verification.search.stack import PLANE, Stack

STEP_NS = 10 * MS
READY_MS, TICK_MS = 2000, 100
DRIVE_S = 120.0
PLACED_SIGMA = 0.05
PLACEMENTS = 50  # attempts
MUTE = 0.25  # share of the vehicles


class Result(Struct, frozen=True, kw_only=True):
    """What the pose of one vehicle was worth, once a second."""

    seed: int
    source: FixModel
    mute: bool  # whether the board loses its counters for some seconds, again and again
    nees: tuple[float, ...]  # squared errors in standard deviations
    error: float  # m, at worst while it was placed
    sigma: float  # m, at worst while it was placed
    placed: float  # share of the time
    used: int
    refused: int


def source_of(chance: random.Random) -> FixModel:
    """Draw a source: tags, UWB, GNSS, or a lidar."""
    return FixModel(
        period=chance.choice((1, 2, 5, 10, 30)),
        sigma=chance.choice((0.02, 0.05, 0.1, 0.3)),
        heading_sigma=chance.choice((0.02, 0.05, None)),
        delay=chance.choice((0, 1, 3, 10)),
        outliers=chance.choice((0.0, 0.05, 0.2)),
        gap=chance.choice((0, 100)),
    )


class Run:
    """A vehicle without faults that drives at random in a plane."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._model = source_of(self._random)
        self._mute = self._random.random() < MUTE
        drawn = draw(seed)
        turning = float(drawn.get(TURN_BRAKING, 1.0))
        self._stack = Stack(drawn.model(), PLANE, seed=seed, step_ns=STEP_NS, turn_braking=turning)
        self._seed = seed
        self._pose: m.MapPose | None = None
        self._truth = self._stack.vehicle.simulation.pose  # when it was published
        process: Any = self._stack.process("localization")
        self._process = process
        process.config = LocalizationConfig(
            localization=Localization(
                sources={SOURCE: SourceSettings(sigma=0.01, heading_sigma=0.01)}
            )
        )
        with self._stack.time():
            LocalizationService(process)
        self._stack.processes["localization"] = process
        self._stack.hand.subscribe(keys.MAP_POSE, self._on_pose)
        self._source = FixSource(self._model, self._stack, self._random)

    def _on_pose(self, arrival: Any) -> None:
        self._pose, self._truth = arrival.message, self._stack.vehicle.simulation.pose

    def go(self, seconds: float) -> Result:
        """Place the vehicle, drive, and compare once a second."""
        self._stack.sources["teleop"].message = m.Drive(linear=0.0, angular=0.0, echo=0)
        self._stack.run(READY_MS)
        assert any(self._place() for _ in range(PLACEMENTS)), self._seed
        nees, error, sigma, placed, ticks = [], 0.0, 0.0, 0, round(seconds * 1000 / TICK_MS)
        for tick in range(ticks):
            if tick % 20 == 0:
                self._request()
            if self._mute and tick % 100 in (0, 30):  # for 3 s of 10
                reports: tuple[q.ReportName, ...] = ("mileage",) if tick % 100 == 0 else ()
                self._stack.vehicle.inject(q.Mute(reports=reports))
            self._source.measure(tick)
            self._stack.run(TICK_MS)
            if tick % 10 == 9 and (found := self._compare()):
                nees.append(found[0])
                if found[1]:
                    placed += 1
                    error, sigma = max(error, found[2]), max(sigma, found[3])
        assert self._pose is not None
        (state,) = self._pose.sources
        return Result(
            seed=self._seed, source=self._model, mute=self._mute, nees=tuple(nees), error=error,
            sigma=sigma, placed=placed / (ticks // 10), used=state.used, refused=state.refused,
        )  # fmt: skip

    def _place(self) -> bool:
        """Place the vehicle as a person does, a little beside the truth; return whether it is.

        With noisy velocities it seems to move now and then.
        """
        request = place_request(self._stack, self._random, PLACED_SIGMA)
        with self._stack.time():
            caller = self._process.call(keys.PLACE, request)
        self._stack.run(TICK_MS)
        return bool(caller.done)

    def _request(self) -> None:
        """Request another velocity."""
        chance = self._random
        turns = chance.random() < 0.3  # on the spot
        linear = 0.0 if turns else chance.choice((0.0, 0.2, 0.5, 0.8, -0.3))
        angular = chance.uniform(-0.6, 0.6)
        self._stack.sources["teleop"].message = m.Drive(linear=linear, angular=angular, echo=0)

    def _compare(self) -> tuple[float, bool, float, float] | None:
        """Return NEES, whether the pose is placed, its error and its standard deviation."""
        pose, truth = self._pose, self._truth
        if pose is None or pose.pose_covariance is None:
            return None
        assert pose.x is not None
        assert pose.y is not None
        assert pose.heading is not None
        turned = math.remainder(pose.heading - truth.heading, math.tau)
        error = (pose.x - truth.x, pose.y - truth.y, turned)
        assert np.linalg.eigvalsh(np.reshape(pose.pose_covariance, (3, 3)))[0] > 0, self._seed
        nees = normalised(error, pose.pose_covariance)
        sigma = math.sqrt(max(pose.pose_covariance[0], pose.pose_covariance[4]))
        return nees, pose.state == "placed", math.hypot(*error[:2]), sigma


def measure(seed: int, seconds: float = DRIVE_S) -> Result:
    """Run one vehicle."""
    return Run(seed).go(seconds)
