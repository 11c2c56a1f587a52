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
counters of another ``boot`` ``corrected`` becomes ``predicted`` and counting restarts: the board
or ``epoch``, or a jump      or the bridge restarted, and the pose must not jump
no input                     the last velocity is valid for ``hold`` seconds; after that the pose
                             does not change, its covariance grows, and nothing is published
a pose from an operator      ``predicted`` is set; ``corrected`` moves along as one rigid body
============================ ===================================================================

Heading is wrapped and distance is an s32 of millimetres: differences are taken modulo both, the
turn nearest to the integrated velocities. While the vehicle stands, the noise of all arcs together
is that of one counter step.
"""

import math
from enum import StrEnum

from msgspec.structs import replace

from common import messages as m
from common.codec import finite
from common.freshness import NS_PER_S, Latest, fresh
from services.odom.config import Odom
from services.odom.pose import (
    ArcSegment,
    Covariance,
    Pose,
    PoseEstimate,
    ProcessNoise,
    fitted,
    halved,
    total,
)
from services.odom.slip_detector import (
    COUNTER_STEP_M,
    COUNTER_STEP_RAD,
    SlipDetector,
    TwistEstimate,
)
from services.odom.standstill import DISTANCE_WRAP_M, Standstill

SEGMENTS_MAX = 512  # about ten seconds of velocities; above that, segments are merged in pairs
# The vehicle cannot exceed these; larger values mean a damaged message or a counter that was set.
PLAUSIBLE_MPS = 5.0
PLAUSIBLE_RADPS = 10.0
JUMP_M = 1.0

# The start pose is exact by definition, except for the counter resolution.
START = Covariance(COUNTER_STEP_M**2, 0.0, COUNTER_STEP_M**2, 0.0, 0.0, COUNTER_STEP_RAD**2)


class Outcome(StrEnum):
    """Result of processing a sample."""

    USED = "used"
    FIRST = "first counters"
    BRIDGE_RESTARTED = "the bridge restarted"
    BOARD_RESTARTED = "the board restarted"
    JUMPED = "the counters jumped"
    LATE = "late"
    NOT_FINITE = "no_number"
    IMPLAUSIBLE = "implausible"


RESTARTS = (Outcome.BRIDGE_RESTARTED, Outcome.BOARD_RESTARTED, Outcome.JUMPED)
REFUSALS = (Outcome.LATE, Outcome.NOT_FINITE, Outcome.IMPLAUSIBLE)


class Estimator:
    """Pose estimator of one vehicle; times are the receiver's monotonic nanoseconds."""

    def __init__(self, settings: Odom) -> None:
        self.epoch = 0  # how often an operator has set the pose
        self._settings = settings
        self._corrected = PoseEstimate(Pose(0.0, 0.0, 0.0), START)
        self._predicted = self._corrected
        self._segments: list[ArcSegment] = []  # from ``corrected`` to ``predicted``
        self._predicted_ns: int | None = None  # the time of ``predicted``
        self._counters: m.Mileage | None = None
        self._velocity: Latest[m.Velocity] | None = None
        self._slip_detector = SlipDetector(settings)
        self._standstill = Standstill(settings)
        # 2 equivalent mutants: it decides nothing before the first counters.
        self._news = False  # counters came since the last estimate

    def on_velocity(self, velocity: m.Velocity, now_ns: int) -> Outcome:
        """Process a measured velocity."""
        if not finite(velocity.linear, velocity.angular):
            return Outcome.NOT_FINITE
        if abs(velocity.linear) > PLAUSIBLE_MPS or abs(velocity.angular) > PLAUSIBLE_RADPS:
            return Outcome.IMPLAUSIBLE
        self._advance(now_ns)
        self._velocity = Latest(velocity, now_ns)
        return Outcome.USED

    def on_mileage(self, mileage: m.Mileage, now_ns: int) -> Outcome:
        """Process a counter sample."""
        if not finite(mileage.distance, mileage.heading):
            return Outcome.NOT_FINITE
        before = self._counters
        if before is not None and before.boot == mileage.boot and mileage.seq <= before.seq:
            return Outcome.LATE
        self._advance(now_ns)
        outcome = Outcome.FIRST if before is None else self._count(before, mileage, now_ns)
        if outcome is not Outcome.USED:
            self._corrected = self._predicted
            self._slip_detector.clear()
        self._predicted = self._corrected
        self._segments = []
        self._counters = mileage
        self._news = True
        return outcome

    def place(self, pose: Pose, now_ns: int) -> None:
        """Set the pose; the vehicle may be moving."""
        self._advance(now_ns)
        old, anchor = self._predicted.pose, self._corrected.pose
        turn = pose.heading - old.heading
        cos, sin = math.cos(turn), math.sin(turn)
        dx, dy = anchor.x - old.x, anchor.y - old.y
        moved = Pose(
            pose.x + cos * dx - sin * dy,
            pose.y + sin * dx + cos * dy,
            math.remainder(anchor.heading + turn, math.tau),
        )
        self._corrected = PoseEstimate(moved, START)
        self._predicted = PoseEstimate(
            Pose(pose.x, pose.y, math.remainder(pose.heading, math.tau)), START
        )
        self.epoch += 1

    def estimate(self, now_ns: int) -> m.Odometry | None:
        """Return pose and twist at ``now_ns``; None without a valid velocity or new counters."""
        twist = self._twist(now_ns)
        if twist is None:
            return None
        # 1 equivalent mutant: None is as false as False.
        self._news = False
        estimate = self._predicted
        for segment in self._extrapolate(now_ns):
            estimate = estimate.moved(segment.distance, segment.turn, self._process_noise(segment))
        self._slip_detector.update(now_ns)
        return m.Odometry(
            x=estimate.pose.x,
            y=estimate.pose.y,
            heading=estimate.pose.heading,
            linear=twist.linear,
            angular=twist.angular,
            pose_covariance=estimate.covariance.rows(),
            twist_covariance=(twist.linear_variance, 0.0, 0.0, twist.angular_variance),
            epoch=self.epoch,
            residual=self._slip_detector.residual,
            slip=self._slip_detector.slip,
        )

    def _count(self, before: m.Mileage, after: m.Mileage, now_ns: int) -> Outcome:
        """Advance the corrected pose by the counted motion, if the counters are continuous."""
        integrated = total(self._segments)
        distance, turn = step(before, after, integrated)
        outcome = check_continuity(before, after, distance, integrated.time_s)
        if outcome is Outcome.USED:
            self._standstill.update(after, self._segments)
            for segment in fitted(self._segments, distance, turn):
                noise = self._counter_noise(self._standstill.noise_part(segment))
                self._corrected = self._corrected.moved(segment.distance, segment.turn, noise)
            counted = replace(integrated, distance=distance, turn=turn)
            self._slip_detector.add(now_ns, counted, integrated)
        return outcome

    def _advance(self, now_ns: int) -> None:
        """Extrapolate the predicted pose to now."""
        for segment in self._extrapolate(now_ns):
            noise = self._process_noise(segment)
            self._predicted = self._predicted.moved(segment.distance, segment.turn, noise)
            self._segments.append(segment)
        if len(self._segments) > SEGMENTS_MAX:
            self._segments = halved(self._segments)
        self._predicted_ns = max(now_ns, self._predicted_ns or now_ns)

    def _extrapolate(self, now_ns: int) -> list[ArcSegment]:
        """Return the arcs from the predicted pose to now: seen while the velocity is valid."""
        start_ns = now_ns if self._predicted_ns is None else self._predicted_ns
        held_ns = start_ns
        segments = []
        if self._velocity is not None:
            held_ns = self._velocity.received_ns + round(self._settings.hold * NS_PER_S)
            held_ns = min(max(start_ns, held_ns), now_ns)
            seen_s = (held_ns - start_ns) / NS_PER_S
            velocity = self._velocity.value
            segments.append(
                ArcSegment(velocity.linear * seen_s, velocity.angular * seen_s, seen_s, seen=True)
            )
        segments.append(ArcSegment(0.0, 0.0, (now_ns - held_ns) / NS_PER_S, seen=False))
        return [segment for segment in segments if segment.time_s > 0]

    def _twist(self, now_ns: int) -> TwistEstimate | None:
        settings = self._settings
        if self._velocity is not None and fresh(self._velocity, now_ns, settings.hold):
            velocity = self._velocity.value
            variances = settings.velocity_noise**2, settings.angular_noise**2
            return TwistEstimate(velocity.linear, velocity.angular, *variances)
        return self._slip_detector.twist(now_ns) if self._news else None

    def _process_noise(self, segment: ArcSegment) -> ProcessNoise:
        """Return the noise of an arc that only velocities measured, or nothing."""
        of, counted = self._settings, self._counter_noise(segment)
        gap_s = self._gap_s(segment)
        return ProcessNoise(
            counted.distance + of.velocity_noise**2 * segment.time_s,
            counted.turn + of.angular_noise**2 * segment.time_s + of.gap_turn_noise**2 * gap_s,
            of.gap_noise**2 * gap_s,
        )

    def _counter_noise(self, segment: ArcSegment) -> ProcessNoise:
        """Return the noise of a counted arc: its end is measured, its shape in a gap is not."""
        of, length = self._settings, abs(segment.distance)
        turn = of.turn_noise**2 * abs(segment.turn) + of.drift_noise**2 * length
        place = of.gap_noise**2 * length if self._gap_s(segment) else 0.0
        return ProcessNoise(of.distance_noise**2 * length, turn, place)

    def _gap_s(self, segment: ArcSegment) -> float:
        return 0.0 if segment.seen else max(0.0, segment.time_s - self._settings.hold)


def step(before: m.Mileage, after: m.Mileage, integrated: ArcSegment) -> tuple[float, float]:
    """Return the counted distance (m) and turn (rad), across counter wraps."""
    distance = math.remainder(after.distance - before.distance, DISTANCE_WRAP_M)
    raw = after.heading - before.heading
    turn = integrated.turn + math.remainder(raw - integrated.turn, math.tau)
    return distance, turn


def check_continuity(
    before: m.Mileage, after: m.Mileage, distance: float, time_s: float
) -> Outcome:
    """Return USED for continuous counters, otherwise the kind of discontinuity."""
    if before.boot != after.boot:
        return Outcome.BRIDGE_RESTARTED
    if before.epoch != after.epoch:
        return Outcome.BOARD_RESTARTED
    if abs(distance) > JUMP_M + PLAUSIBLE_MPS * time_s:
        return Outcome.JUMPED
    return Outcome.USED
