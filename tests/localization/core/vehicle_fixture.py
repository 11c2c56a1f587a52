"""A vehicle whose truth is known: odometry with its own noise model, and fixes of the truth."""

import math
import random
from typing import Any

from common.freshness import NS_PER_S
from common.pose import Covariance, Pose
from services.localization.config import FixSource, Localization
from services.localization.core.estimate import Located
from services.localization.core.localizer import Localizer
from services.odom.config import Odom
from services.odom.core.estimator import Estimator
from t2.messages import Fix, MapPose, Mileage, Odometry, Velocity

STEP_NS = NS_PER_S // 25
STEP_S = 0.04
BOOT = 7
START = Pose(0.0, 0.0, 0.0)
SIGMA = 0.05  # of a fix: m, rad


def diagonal(sigma: float, heading: float) -> tuple[float, ...]:
    """Return the covariance of independent errors, row by row."""
    return (sigma**2, 0.0, 0.0, 0.0, sigma**2, 0.0, 0.0, 0.0, heading**2)


class Drive:
    """Odometry of a vehicle that starts at a pose in the map, and its localizer."""

    def __init__(self, start: Pose = START, seed: int = 0, **sources: Any) -> None:
        self.random = random.Random(seed)
        self.true = start
        self.seq, self.now_ns, self.boot = 0, 0, BOOT
        self.half = (0.0, 0.0)
        self.counts = True  # whether counters arrive
        self.noise = Odom()
        self.localizer = Localizer(
            Localization(sources={name: FixSource(**of) for name, of in sources.items()})
        )
        self.odometry: Odometry | None = None
        self.restart()

    def restart(self) -> None:
        """Start odometry anew."""
        self.estimator = Estimator(self.noise)
        self.distance = self.turn = 0.0
        self.boot += 1
        self.seq = 0

    def go(self, linear: float = 0.0, angular: float = 0.0, steps: int = 1) -> MapPose:
        """Drive for some steps; return the pose in the map."""
        for _ in range(steps):
            self.step(linear, angular)
            self.localizer.on_odometry(self.odometry, self.now_ns)  # type: ignore[arg-type]
        return self.pose()

    def step(self, linear: float, angular: float) -> None:
        """Move the vehicle, and estimate; nobody receives it yet."""
        self.now_ns += STEP_NS
        self.seq += 1
        distance, turn = linear * STEP_S, angular * STEP_S
        self.half = distance / 2, turn / 2
        of = self.noise
        away = self.random.gauss(0.0, of.distance_noise * math.sqrt(abs(distance)))
        variance = of.turn_noise**2 * abs(turn) + of.drift_noise**2 * abs(distance)
        self.true = self.true.moved(
            distance + away, turn + self.random.gauss(0.0, math.sqrt(variance))
        )
        self.distance += distance
        self.turn = math.remainder(self.turn + turn, math.tau)
        velocity = Velocity(linear=linear, angular=angular)
        self.estimator.on_velocity(velocity, self.now_ns)
        if self.counts:
            counters = Mileage(distance=self.distance, heading=self.turn, epoch=0)
            self.estimator.on_mileage(counters, self.now_ns)
        self.odometry = self.header(self.estimator.estimate(self.now_ns))

    def header(self, odometry: Odometry | None) -> Odometry:
        """Return odometry as the bus delivers it."""
        assert odometry is not None
        fields = {name: getattr(odometry, name) for name in odometry.__struct_fields__}
        return Odometry(**fields | {"boot": self.boot, "seq": self.seq, "mono_ns": self.now_ns})

    def place(self, sigma: float = 0.01, pose: Pose | None = None) -> MapPose:
        """Place the vehicle at its true pose, or at another one."""
        located = Located(pose or self.true, Covariance.of(diagonal(sigma, sigma)))
        assert self.localizer.place(located, self.now_ns) is None
        return self.pose()

    def measured(self, *, turned: bool = True, sigma: float = SIGMA, **about: Any) -> Fix:
        """Return a fix of the true pose, measured halfway to the next odometry."""
        noise, true = self.random.gauss, self.true.moved(*self.half)
        fields: dict[str, Any] = {
            "x": true.x + noise(0.0, sigma),
            "y": true.y + noise(0.0, sigma),
            "heading": true.heading + noise(0.0, SIGMA) if turned else None,
            "covariance": diagonal(sigma, SIGMA),
            "odom_boot": self.boot,
            "odom_seq": self.seq,
        }
        return Fix(**fields | about)

    def fix(self, fix: Fix | None = None, source: str = "tags") -> str:
        """Deliver a fix of the true pose, or this one; return why it was refused."""
        self.localizer.on_fix(source, fix or self.measured(), self.now_ns)
        (state,) = (each for each in self.pose().sources if each.source == source)
        return state.text

    def pose(self) -> MapPose:
        """Return the pose in the map."""
        pose = self.localizer.pose(self.now_ns)
        assert pose is not None
        return pose

    def error(self) -> tuple[float, float]:
        """Return the error of the pose: m and rad."""
        pose = self.pose()
        assert pose.x is not None
        assert pose.y is not None
        assert pose.heading is not None
        turned = math.remainder(pose.heading - self.true.heading, math.tau)
        return math.dist((pose.x, pose.y), (self.true.x, self.true.y)), abs(turned)
