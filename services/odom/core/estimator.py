"""Pose and twist estimation from counters and velocities.

The board counts distance and heading (manual 2.3); these counters are the reference. Velocities
(manual 2.2) extrapolate the pose from the last counter sample to now, and give the shape of the
trajectory between two samples. The error after lost frames is therefore that of the counters:

============================ ===================================================================
input                        effect on the pose
============================ ===================================================================
velocity                     ``predicted`` advances by the arc since the last input;
                             ``corrected`` does not change
counters                     ``corrected`` advances by the arc segments since the last counters,
                             fitted to them; ``predicted`` becomes ``corrected``
counters of another ``boot`` ``corrected`` becomes ``predicted`` and counting restarts: the bridge
or ``epoch``                 or the board restarted, and the pose must not jump
no input                     the last velocity is valid for ``HOLD_S``; after that the pose
                             does not change, its covariance grows, and nothing is published
a pose from an operator      both are set; counting restarts with the next counters
============================ ===================================================================

The bridge refuses implausible values, and detects counters that jumped or wrapped: ``epoch``.
"""

import math
from collections import deque

from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest, fresh
from common.pose import Covariance, Pose
from common.standstill import comparable
from services.odom.config import Odom
from services.odom.core.noise import COUNTER_STEP_M, COUNTER_STEP_RAD, HOLD_S, NoiseModel
from services.odom.core.pose import ArcSegment, PoseEstimate, fitted, halved, total
from t2 import messages as m

SEGMENTS_MAX = 512  # five seconds without counters; above that, segments are merged in pairs
COMPARED_NS = NS_PER_S  # window of slip detection
SLIP_M, SLIP_RAD = 0.1, 0.2  # in that window
# The start pose is exact by definition, except for the counter resolution.
START = Covariance(COUNTER_STEP_M**2, 0.0, COUNTER_STEP_M**2, 0.0, 0.0, COUNTER_STEP_RAD**2)


class SlipDetector:
    """Compares counters with velocities over the last second."""

    def __init__(self) -> None:
        self.residual: float | None = None  # m, counters minus velocities
        self.slip = False
        self._differences: deque[tuple[int, float, float]] = deque()  # time, m, rad
        self._seen = True

    def add(self, end_ns: int, counted: ArcSegment, integrated: ArcSegment) -> None:
        """Add the motion up to a new counter sample.

        A motion without velocities is left out, and so is the one after it: after a stall of this
        process its counters may have been measured before the gap.
        """
        if integrated.seen and self._seen:
            distance = counted.distance - integrated.distance
            self._differences.append((end_ns, distance, counted.turn - integrated.turn))
        self._seen = integrated.seen

    def update(self, now_ns: int) -> None:
        """Compare the last second; set ``slip`` above a limit and clear it below half of it."""
        while self._differences and now_ns - self._differences[0][0] > COMPARED_NS:
            self._differences.popleft()
        distance = sum(each[1] for each in self._differences)
        turn = sum(each[2] for each in self._differences)
        part = 0.5 if self.slip else 1.0
        limits = SLIP_M * part, SLIP_RAD * part
        self.slip = abs(distance) > limits[0] or abs(turn) > limits[1]
        self.residual = distance if self._differences else None


class Estimator:
    """Pose estimator of one vehicle; times are the receiver's monotonic nanoseconds."""

    def __init__(self, settings: Odom) -> None:
        self.epoch = 0  # how often an operator has set the pose
        self._settings = settings
        self._corrected = PoseEstimate(Pose(0.0, 0.0, 0.0), START)
        self._predicted = self._corrected
        self._segments: list[ArcSegment] = []  # from ``corrected`` to ``predicted``
        self._predicted_ns = 0  # the time of ``predicted``; 0 before any input
        self._counters: m.Mileage | None = None
        self._velocity: Latest[m.Velocity] | None = None
        self._noise = NoiseModel(settings)
        self._slip_detector = SlipDetector()

    def on_velocity(self, velocity: m.Velocity, now_ns: int) -> None:
        """Process a measured velocity."""
        self._advance(now_ns)
        self._velocity = Latest(velocity, now_ns)

    def on_mileage(self, mileage: m.Mileage, now_ns: int) -> bool:
        """Process a counter sample; return whether the counters restarted."""
        self._advance(now_ns)
        before, self._counters = self._counters, mileage
        restarted = before is not None and not comparable(before, mileage)
        if before is None or restarted:
            self._corrected = self._predicted
        else:
            self._count(before, mileage, now_ns)
        self._predicted = self._corrected
        self._segments = []
        return restarted

    def place(self, pose: Pose, now_ns: int) -> None:
        """Set the pose; the vehicle may be moving."""
        self._advance(now_ns)
        self._corrected = self._predicted = PoseEstimate(pose.moved(0.0, 0.0), START)
        self._counters = None
        self.epoch += 1

    def estimate(self, now_ns: int) -> m.Odometry | None:
        """Return pose and twist at ``now_ns``; None without a valid velocity."""
        settings, velocity = self._settings, self._velocity
        if velocity is None or not fresh(velocity, now_ns, HOLD_S):
            return None
        self._advance(now_ns)
        self._slip_detector.update(now_ns)
        pose = self._predicted.pose
        return m.Odometry(
            x=pose.x,
            y=pose.y,
            heading=pose.heading,
            linear=velocity.value.linear,
            angular=velocity.value.angular,
            pose_covariance=self._predicted.covariance.rows(),
            twist_covariance=(settings.velocity_noise**2, 0.0, 0.0, settings.angular_noise**2),
            epoch=self.epoch,
            residual=self._slip_detector.residual,
            slip=self._slip_detector.slip,
        )

    def _count(self, before: m.Mileage, after: m.Mileage, now_ns: int) -> None:
        """Advance the corrected pose by the counted motion.

        The heading is wrapped: of all turns the one nearest to the velocities counts.
        """
        integrated = total(self._segments)
        distance = after.distance - before.distance
        turn = after.heading - before.heading
        turn = integrated.turn + math.remainder(turn - integrated.turn, math.tau)
        self._noise.update(after, self._segments)
        for segment in fitted(self._segments, distance, turn):
            noise = self._noise.counted(segment)
            self._corrected = self._corrected.moved(segment.distance, segment.turn, noise)
        counted = replace(integrated, distance=distance, turn=turn)
        self._slip_detector.add(now_ns, counted, integrated)

    def _advance(self, now_ns: int) -> None:
        """Extrapolate the predicted pose to now: by the velocity while it is valid."""
        start_ns = held_ns = self._predicted_ns or now_ns
        linear = angular = 0.0
        if self._velocity is not None:
            linear, angular = self._velocity.value.linear, self._velocity.value.angular
            held_ns = self._velocity.received_ns + round(HOLD_S * NS_PER_S)
            held_ns = min(max(start_ns, held_ns), now_ns)
        seen_s, unseen_s = (held_ns - start_ns) / NS_PER_S, (now_ns - held_ns) / NS_PER_S
        for segment in (
            ArcSegment(linear * seen_s, angular * seen_s, seen_s, seen=True),
            ArcSegment(0.0, 0.0, unseen_s, seen=False),
        ):
            if segment.time_s > 0:
                noise = self._noise.extrapolated(segment)
                self._predicted = self._predicted.moved(segment.distance, segment.turn, noise)
                self._segments.append(segment)
        if len(self._segments) > SEGMENTS_MAX:
            self._segments = halved(self._segments)
        self._predicted_ns = max(now_ns, self._predicted_ns)
