"""Counters and velocities to pose and twist.

The board counts distance and heading (manual 2.3); these counters are the truth. Velocities
(manual 2.2) carry the pose on from the last counter sample to now, and give the way between two
samples its shape. So the error after any pattern of lost frames is that of the counters:

============================ ===================================================================
what comes                   what becomes of the pose
============================ ===================================================================
velocity                     ``lead`` goes on by the arc since the last input; ``anchor`` stays
counters                     ``anchor`` goes on by the legs since the last counters, fitted to
                             what was counted; ``lead`` becomes ``anchor``
counters of another ``boot`` ``anchor`` becomes ``lead`` and counting starts from here: the board
or ``epoch``, or a jump      or the bridge started anew, and the pose must not jump
nothing                      the last velocity holds for ``hold`` seconds; after that the pose
                             stays, its covariance grows, and nothing is published
a pose from an operator      ``lead`` is put there and ``anchor`` moved along, as one rigid body
============================ ===================================================================

Heading is wrapped and distance is an s32 of millimetres: steps are taken modulo both, the turn
nearest to what the velocities saw. While the vehicle stands, the noise of all arcs together is that
of one step of the counters.
"""

import math
from enum import StrEnum

from msgspec.structs import replace

from common import messages as m
from common.codec import finite
from common.freshness import NS_PER_S, Latest, fresh
from services.odom.arc_segments import Leg, fitted, halved, total
from services.odom.config import Odom
from services.odom.pose import Covariance, Pose, PoseEstimate, ProcessNoise
from services.odom.slip_detector import COUNTER_STEP_M, COUNTER_STEP_RAD, Comparison, TwistEstimate
from services.odom.standstill import DISTANCE_WRAP_M, Standstill

LEGS_MAX = 512  # about ten seconds of velocities; then the oldest shape gets coarser
# No such vehicle drives or turns faster; more is a damaged message or a counter that was set.
PLAUSIBLE_MPS = 5.0
PLAUSIBLE_RADPS = 10.0
JUMP_M = 1.0

# Where the estimate starts is right by definition, but for the counters' own steps.
START = Covariance(COUNTER_STEP_M**2, 0.0, COUNTER_STEP_M**2, 0.0, 0.0, COUNTER_STEP_RAD**2)


class Outcome(StrEnum):
    """What a sample did."""

    USED = "used"
    FIRST = "first counters"
    BRIDGE_RESTARTED = "the bridge started anew"
    BOARD_RESTARTED = "the board started anew"
    JUMPED = "the counters jumped"
    LATE = "late"
    NO_NUMBER = "no_number"
    IMPLAUSIBLE = "implausible"


RESTARTS = (Outcome.BRIDGE_RESTARTED, Outcome.BOARD_RESTARTED, Outcome.JUMPED)
REFUSALS = (Outcome.LATE, Outcome.NO_NUMBER, Outcome.IMPLAUSIBLE)


class Estimator:
    """Follows one vehicle; times are the receiver's monotonic nanoseconds."""

    def __init__(self, settings: Odom) -> None:
        self.epoch = 0  # how often an operator has set the pose
        self._settings = settings
        self._anchor = PoseEstimate(Pose(0.0, 0.0, 0.0), START)
        self._lead = self._anchor
        self._legs: list[Leg] = []  # from anchor to lead
        self._at_ns: int | None = None  # the time of lead
        self._counters: m.Mileage | None = None
        self._velocity: Latest[m.Velocity] | None = None
        self._comparison = Comparison(settings)
        self._standstill = Standstill(settings)
        self._news = False  # counters came since the last estimate

    def on_velocity(self, velocity: m.Velocity, now_ns: int) -> Outcome:
        """Take a measured velocity."""
        if not finite(velocity.linear, velocity.angular):
            return Outcome.NO_NUMBER
        if abs(velocity.linear) > PLAUSIBLE_MPS or abs(velocity.angular) > PLAUSIBLE_RADPS:
            return Outcome.IMPLAUSIBLE
        self._advance(now_ns)
        self._velocity = Latest(velocity, now_ns)
        return Outcome.USED

    def on_mileage(self, mileage: m.Mileage, now_ns: int) -> Outcome:
        """Take the counters."""
        if not finite(mileage.distance, mileage.heading):
            return Outcome.NO_NUMBER
        before = self._counters
        if before is not None and before.boot == mileage.boot and mileage.seq <= before.seq:
            return Outcome.LATE
        self._advance(now_ns)
        outcome = Outcome.FIRST if before is None else self._count(before, mileage, now_ns)
        if outcome is not Outcome.USED:
            self._anchor = self._lead
            self._comparison.clear()
        self._lead = self._anchor
        self._legs = []
        self._counters = mileage
        self._news = True
        return outcome

    def place(self, pose: Pose, now_ns: int) -> None:
        """Put the vehicle at a pose; it may be moving."""
        self._advance(now_ns)
        old, anchor = self._lead.pose, self._anchor.pose
        turn = pose.heading - old.heading
        cos, sin = math.cos(turn), math.sin(turn)
        dx, dy = anchor.x - old.x, anchor.y - old.y
        moved = Pose(
            pose.x + cos * dx - sin * dy,
            pose.y + sin * dx + cos * dy,
            math.remainder(anchor.heading + turn, math.tau),
        )
        self._anchor = PoseEstimate(moved, START)
        self._lead = PoseEstimate(
            Pose(pose.x, pose.y, math.remainder(pose.heading, math.tau)), START
        )
        self.epoch += 1

    def estimate(self, now_ns: int) -> m.Odometry | None:
        """Return pose and twist as of now; None while there is nothing new to go by."""
        twist = self._twist(now_ns)
        if twist is None:
            return None
        self._news = False
        belief = self._lead
        for leg in self._ahead(now_ns):
            belief = belief.moved(leg.distance, leg.turn, self._spread(leg))
        self._comparison.look_back(now_ns)
        return m.Odometry(
            x=belief.pose.x,
            y=belief.pose.y,
            heading=belief.pose.heading,
            linear=twist.linear,
            angular=twist.angular,
            pose_covariance=belief.covariance.rows(),
            twist_covariance=(twist.linear_variance, 0.0, 0.0, twist.angular_variance),
            epoch=self.epoch,
            residual=self._comparison.residual,
            slip=self._comparison.slip,
        )

    def _count(self, before: m.Mileage, after: m.Mileage, now_ns: int) -> Outcome:
        """Move the anchor on by what was counted, if the counters go on from those before."""
        integrated = total(self._legs)
        distance, turn = step(before, after, integrated)
        outcome = judge(before, after, distance, integrated.time_s)
        if outcome is Outcome.USED:
            self._standstill.update(after, self._legs)
            for leg in fitted(self._legs, distance, turn):
                spread = self._spread_of_counters(self._standstill.noisy(leg))
                self._anchor = self._anchor.moved(leg.distance, leg.turn, spread)
            counted = replace(integrated, distance=distance, turn=turn)
            self._comparison.add(now_ns, counted, integrated)
        return outcome

    def _advance(self, now_ns: int) -> None:
        """Carry the lead on to now."""
        for leg in self._ahead(now_ns):
            spread = self._spread(leg)
            self._lead = self._lead.moved(leg.distance, leg.turn, spread)
            self._legs.append(leg)
        if len(self._legs) > LEGS_MAX:
            self._legs = halved(self._legs)
        self._at_ns = max(now_ns, self._at_ns or now_ns)

    def _ahead(self, now_ns: int) -> list[Leg]:
        """Return the way from the lead to now: as long as the velocity holds, then unseen."""
        start_ns = now_ns if self._at_ns is None else self._at_ns
        held_ns = start_ns
        legs = []
        if self._velocity is not None:
            held_ns = self._velocity.received_ns + round(self._settings.hold * NS_PER_S)
            held_ns = min(max(start_ns, held_ns), now_ns)
            seen_s = (held_ns - start_ns) / NS_PER_S
            velocity = self._velocity.value
            legs.append(Leg(velocity.linear * seen_s, velocity.angular * seen_s, seen_s, seen=True))
        legs.append(Leg(0.0, 0.0, (now_ns - held_ns) / NS_PER_S, seen=False))
        return [leg for leg in legs if leg.time_s > 0]

    def _twist(self, now_ns: int) -> TwistEstimate | None:
        settings = self._settings
        if self._velocity is not None and fresh(self._velocity, now_ns, settings.hold):
            velocity = self._velocity.value
            variances = settings.velocity_noise**2, settings.angular_noise**2
            return TwistEstimate(velocity.linear, velocity.angular, *variances)
        return self._comparison.twist(now_ns) if self._news else None

    def _spread(self, leg: Leg) -> ProcessNoise:
        """Return how well an arc is known by velocities alone, or while there was none."""
        of, way, gap_s = self._settings, self._spread_of_counters(leg), self._gap_s(leg)
        return ProcessNoise(
            way.distance + of.velocity_noise**2 * leg.time_s,
            way.turn + of.angular_noise**2 * leg.time_s + of.gap_turn_noise**2 * gap_s,
            of.gap_noise**2 * gap_s,
        )

    def _spread_of_counters(self, leg: Leg) -> ProcessNoise:
        """Return how well an arc is known that was counted: its ends, not its shape in a gap."""
        of, way = self._settings, abs(leg.distance)
        turn = of.turn_noise**2 * abs(leg.turn) + of.drift_noise**2 * way
        place = of.gap_noise**2 * way if self._gap_s(leg) else 0.0
        return ProcessNoise(of.distance_noise**2 * way, turn, place)

    def _gap_s(self, leg: Leg) -> float:
        return 0.0 if leg.seen else max(0.0, leg.time_s - self._settings.hold)


def step(before: m.Mileage, after: m.Mileage, integrated: Leg) -> tuple[float, float]:
    """Return how far (m, rad) the counters went on, over their wraps."""
    distance = math.remainder(after.distance - before.distance, DISTANCE_WRAP_M)
    raw = after.heading - before.heading
    turn = integrated.turn + math.remainder(raw - integrated.turn, math.tau)
    return distance, turn


def judge(before: m.Mileage, after: m.Mileage, distance: float, time_s: float) -> Outcome:
    """Tell whether counters go on from those before, and if not, why."""
    if before.boot != after.boot:
        return Outcome.BRIDGE_RESTARTED
    if before.epoch != after.epoch:
        return Outcome.BOARD_RESTARTED
    if abs(distance) > JUMP_M + PLAUSIBLE_MPS * time_s:
        return Outcome.JUMPED
    return Outcome.USED
