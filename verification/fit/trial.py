"""Runs of a simulated vehicle with given settings: a lap in a hall, and drives at its walls.

Contact is the simulator's truth, at each of its steps. It happens at 5 mm, the bumper's travel.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import Struct

from common.settings import Vehicle
from sim import requests as q
from sim.model import Model
from sim.trace import Truth
from sim.world import Plan, Wall
from t2 import keys
from t2.messages import Drive, Odometry
from verification.search.bus import MS
from verification.search.stack import Stack

STEP_MS = 10  # of the simulator: no contact is missed
HALF = 5.0  # m
CORNERS = ((-HALF, -HALF), (HALF, -HALF), (HALF, HALF), (-HALF, HALF), (-HALF, -HALF))
HALL = Plan(title="a hall", walls=(Wall(points=CORNERS),))
GOALS = ((2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0))  # m, from the start
NEAR, TRUE_NEAR = 0.15, 0.4  # m from a goal, by odometry and in truth: counters are not exact
FACING, TOWARD = 0.25, 0.6  # rad; share of the greatest speed for each metre that is left
SLOWEST = 0.4  # rad/s, of a turn on the spot: beyond the motors' dead zone
LAP_MS, TICK_MS = 90_000, 50
ALONG, SLANT = math.pi / 2, 0.5  # rad
SHARES, FAST = (0.4, 0.7, 1.0), 0.7  # of the greatest allowed speed; of turns
READY_MS, REST_MS, BEGIN_MS, LOOK_MS, LONGEST_MS = 2000, 1000, 1000, 500, 12_000
STILL = Drive(linear=0.0, angular=0.0, echo=0)


class Approach(Struct, frozen=True):
    """A drive from a place beside the wall at ``x = HALF``; ``gap`` is from the middle to it."""

    name: str
    gap: float  # m
    heading: float  # rad, 0 toward the wall
    request: Drive


class Runs(Struct, frozen=True, kw_only=True):
    """What happened in the runs with one set of settings."""

    failed: str  # why the lap was not completed; empty if it was
    contacts: tuple[str, ...]  # approaches that ended with one
    nearest: float  # m, the least gap to a wall; 0 with a contact


def approaches(body: Vehicle) -> Iterator[Approach]:
    """Yield approaches ahead, astern and at a slant, and turns and curves beside the wall."""
    reach = math.hypot(body.length, body.width) / 2
    for share in SHARES:
        speed, rate = share * body.max_linear, share * body.max_angular
        gap = body.length / 2 + 0.3 + 0.5 * speed + 2 * speed**2  # room to reach the speed
        for name, heading, sign in (("forward", 0.0, 1), ("backward", math.pi, -1)):
            go = Drive(linear=sign * speed, angular=0.0, echo=0)
            yield Approach(f"{name} at {speed:g} m/s", gap, heading, go)
            if share == 1:
                yield Approach(f"{name} at {speed:g} m/s, at a slant", gap, heading + SLANT, go)
        for name, sign in (("left", 1), ("right", -1)) if share >= FAST else ():
            turn = Drive(linear=0.0, angular=sign * rate, echo=0)
            yield Approach(f"{name} at {rate:g} rad/s", reach + 0.1 * share, ALONG, turn)
            if share == 1:
                curve = Drive(linear=speed, angular=sign * rate, echo=0)
                yield Approach(f"curve {name} at {speed:g} m/s", reach + 0.6, -sign * ALONG, curve)


class Trial:
    """The runs of one vehicle."""

    def __init__(self, model: Model, turn_braking: float, settings: Mapping[str, Any]) -> None:
        self._stack = Stack(
            model, HALL, step_ns=STEP_MS * MS, turn_braking=turn_braking, settings=settings
        )
        self._body: Vehicle = self._stack.processes["safety"].config.vehicle
        self._teleop = self._stack.sources["teleop"]
        self._pose: Odometry | None = None
        self._touched = False
        self._stack.hand.subscribe(keys.ODOMETRY, self._on_odometry)
        self._hold(STILL, READY_MS)

    def run(self) -> Runs:
        """Drive the lap, then all approaches."""
        failed = self.lap()
        gaps = {each.name: self.approach(each) for each in approaches(self._body)}
        contacts = tuple(name for name, gap in gaps.items() if not gap)
        return Runs(failed=failed, contacts=contacts, nearest=min(gaps.values()))

    # --- the lap ----------------------------------------------------------------------------

    def lap(self) -> str:
        """Drive from goal to goal by odometry; return what failed."""
        end_ns = self._stack.net.now_ns + LAP_MS * MS
        for number, (x, y) in enumerate(GOALS):
            while (left := self._left(x, y)) > NEAR:
                if self._stack.net.now_ns > end_ns:
                    causes = ", ".join(self._causes())
                    return f"goal {number + 1} not reached, {left:.2f} m are left: {causes}"
                if self._stack.seen and self._stack.seen.latched:
                    return f"latched before goal {number + 1}: {', '.join(self._causes())}"
                self._hold(self._toward(x, y), TICK_MS)
            truth = self._stack.vehicle.simulation.pose
            if (off := math.hypot(x - truth.x, y - truth.y)) > TRUE_NEAR:
                return f"goal {number + 1} missed by {off:.2f} m"
        self._hold(STILL, REST_MS)
        return ""

    def _left(self, x: float, y: float) -> float:
        pose = self._pose
        return math.hypot(x - pose.x, y - pose.y) if pose else math.inf

    def _toward(self, x: float, y: float) -> Drive:
        """Return the request that drives at a goal; it turns on the spot first."""
        if (pose := self._pose) is None:
            return STILL
        off = math.remainder(math.atan2(y - pose.y, x - pose.x) - pose.heading, math.tau)
        if abs(off) > FACING:
            turn = min(self._body.max_angular, max(SLOWEST, abs(off)))
            return Drive(linear=0.0, angular=math.copysign(turn, off), echo=0)
        speed = self._body.max_linear * min(1.0, TOWARD * self._left(x, y) + 0.1)
        return Drive(linear=speed, angular=off, echo=0)

    # --- the walls --------------------------------------------------------------------------

    def approach(self, approach: Approach) -> float:
        """Request motion until the vehicle stands; return its least gap (m), 0 for a contact."""
        place = q.Place(x=HALF - approach.gap, y=0.0, heading=approach.heading)
        self._stack.vehicle.inject(place)
        self._hold(STILL, REST_MS)
        if self._stack.seen and self._stack.seen.latched:
            self._stack.reset()
            self._hold(STILL, REST_MS)
        first, self._touched = len(self._stack.vehicle.records), False
        self._hold(approach.request, BEGIN_MS)
        for _ in range(LONGEST_MS // LOOK_MS):
            driven = self._stack.vehicle.truth
            self._hold(approach.request, LOOK_MS)
            if self._stands_since(driven):
                break
        records = self._stack.vehicle.records[first:]
        gaps = [it.clearance for it in records if isinstance(it, Truth) and it.clearance]
        return 0.0 if self._touched else min(gaps, default=math.inf)

    def _stands_since(self, before: Truth) -> bool:
        now = self._stack.vehicle.truth
        return now.distance - before.distance < 0.005 and abs(now.heading - before.heading) < 0.01

    def _hold(self, request: Drive, duration_ms: int) -> None:
        """Request a motion for this time, and let go when safety wants that."""
        for _ in range(duration_ms // STEP_MS):
            self._teleop.message = STILL if "neutral" in self._causes() else request
            self._stack.run(STEP_MS)
            self._touched |= self._stack.vehicle.simulation.board.pressed

    def _causes(self) -> list[str]:
        return [cause.name for cause in self._stack.seen.causes] if self._stack.seen else []

    def _on_odometry(self, arrival: Any) -> None:
        self._pose = arrival.message
