"""Verdict on a round by the simulator's truth. It uses nothing of patrol but its messages."""

import math
from itertools import pairwise
from typing import Any

from common.freshness import NS_PER_S
from sim.geometry import Segment, point_gap
from t2 import keys
from t2 import messages as m
from verification.patrol.robot import Robot
from verification.search.bus import MS

MOVING = ("driving", "waiting", "returning")  # states in which a round requests motion
NOTICED_NS = 100 * MS  # from a message to its effect: two ticks of patrol
ASKED_NS = 100 * MS  # that a request counts as one of now
REACT_S, BRAKING_MPS2, SLACK = 0.4, 0.6, 0.1  # of a stop; m


class Judge:
    """Looks at patrol's requests and at the truth."""

    def __init__(self, robot: Robot, route: m.Route) -> None:
        self.violations: list[str] = []
        self.deviation = 0.0  # m, true, at worst while motion was requested
        self.state: m.PatrolState | None = None
        self.pose: m.MapPose | None = None
        self.claims = ""  # of patrol, when the deviation was at its worst
        self._robot = robot
        self._corridor = route.corridor
        places = [(each.x, each.y) for each in route.points]
        self.home = places[0]
        self._lines = [Segment(*a, *b) for a, b in pairwise(places)]
        self._moves_ns = -NS_PER_S  # when patrol last requested motion
        self._left_at: float | None = None  # m driven, when it left the corridor
        self._barred: tuple[str, int] | None = None  # why no motion may be requested, since when
        self._stands_ns: int | None = None  # since when the state allows no motion
        self._boots: dict[str, int] = {}
        self._placement = 0
        hand = robot.hand
        hand.subscribe(keys.DRIVE, self._on_drive, source="patrol", depth=16)
        hand.subscribe(keys.SAFETY, self._on_safety)
        hand.subscribe(keys.MAP_POSE, self._on_pose)
        hand.subscribe(keys.PATROL, self._on_state, depth=16)

    @property
    def from_home(self) -> float:
        """The true distance from home, m."""
        truth = self._robot.vehicle.simulation.pose
        return math.dist(self.home, (truth.x, truth.y))

    @property
    def from_route(self) -> float:
        """The true distance from the route, m."""
        truth = self._robot.vehicle.simulation.pose
        return min(point_gap(truth.x, truth.y, line) for line in self._lines)

    def resumed(self) -> None:
        """Note that an operator has started or resumed the round."""
        self._barred = None

    def look(self) -> None:
        """Compare the truth with the corridor."""
        simulation, now_ns = self._robot.vehicle.simulation, self._robot.net.now_ns
        if now_ns - self._moves_ns > ASKED_NS:
            self._left_at = None
            return
        deviation = self.from_route
        if deviation > self.deviation:
            self.deviation, self.claims = deviation, self._claims()
        if deviation <= self._corridor:
            self._left_at = None
            return
        driven, speed = self._robot.vehicle.truth.distance, abs(simulation.twist.linear)
        self._left_at = driven if self._left_at is None else self._left_at
        if driven - self._left_at > REACT_S * speed + speed**2 / (2 * BRAKING_MPS2) + SLACK:
            self._violate(f"outside without a stop: {deviation - self._corridor:.2f} m")

    def _claims(self) -> str:
        state = self.state
        if state is None or state.deviation is None or state.sigma is None:
            return ""
        return f"{state.deviation:.2f} m, sigma {state.sigma:.2f} m"

    def _violate(self, text: str) -> None:
        kind = text.partition(":")[0]
        if not any(each.startswith(kind) for each in self.violations):
            at_s = self._robot.net.now_ns / NS_PER_S
            self.violations.append(f"{text}, at {at_s:.1f} s")

    # --- messages ---------------------------------------------------------------------------

    def _on_drive(self, arrival: Any) -> None:
        if not (arrival.message.linear or arrival.message.angular):
            return
        self._moves_ns = now_ns = self._robot.net.now_ns
        if self._barred and now_ns - self._barred[1] > NOTICED_NS:
            self._violate(f"motion after {self._barred[0]}")
        if self._stands_ns is not None and now_ns - self._stands_ns > NOTICED_NS:
            self._violate(f"motion while {self.state.state if self.state else 'silent'}")

    def _on_safety(self, arrival: Any) -> None:
        self._on_boot("safety", arrival.message)
        if arrival.message.latched:
            self._bar("a latch")

    def _on_pose(self, arrival: Any) -> None:
        self.pose = arrival.message
        self._on_boot("localization", arrival.message)
        if arrival.message.placement != self._placement:
            self._placement = arrival.message.placement
            self._bar("a placement")

    def _on_state(self, arrival: Any) -> None:
        self.state = arrival.message
        self._on_boot("patrol", arrival.message)
        if arrival.message.state in MOVING:
            self._stands_ns = None
        elif self._stands_ns is None:
            self._stands_ns = self._robot.net.now_ns

    def _on_boot(self, name: str, message: m.Message) -> None:
        if self._boots.setdefault(name, message.boot) != message.boot:
            self._boots[name] = message.boot
            self._bar(f"a restart of {name}")

    def _bar(self, why: str) -> None:
        self._barred = self._barred or (why, self._robot.net.now_ns)
