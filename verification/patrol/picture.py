"""``python -m verification.patrol.picture OUT.png``: three rounds of a route, as a picture.

The vehicle counts wrong, its source of fixes is noisy, with outliers and gaps, and a person stands
in the way for a while. Simulated time, the same picture each time.
"""

import argparse
import math
import random
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from common.freshness import NS_PER_S
from common.motion import Twist
from common.pose import Covariance
from sim import requests as q
from sim.geometry import Pose
from sim.vehicle import moved
from sim.world import Box, Plan, Spot, Wall
from t2 import keys
from t2 import messages as m
from verification.localization.source import SOURCE, FixModel, FixSource, place_request
from verification.patrol.draw import NAME, SPACING, Person, Point, Scene
from verification.patrol.judge import MOVING, Judge
from verification.patrol.robot import Robot
from verification.patrol.run import LOOK_MS, TICK_MS
from verification.search.bus import ROBOT
from verification.search.draw import Draw

SEED, ROUNDS = 1, 3
READY_MS, PLACED_SIGMA = 3000, 0.05  # until the round starts; m and rad
LONGEST_S = 200.0  # of a round
APART = 1.8  # m, between two ellipses of a round
WORN = {
    "sim.counters.scale": 0.008,
    "sim.counters.turn_scale": 0.01,
    "sim.counters.pull": 0.003,
    "sim.counters.noise": 0.005,
    "sim.counters.turn_noise": 0.01,
}  # as the profile worn-wheels
LEFT, TURN, LOW, HIGH, RADIUS = 2.5, 11.0, 2.4, 7.6, 2.6  # m, of the route


class Sample(Struct, frozen=True):
    """What patrol publishes of a moving vehicle, and the truth."""

    round: int
    progress: float  # m
    deviation: float  # m, of the believed pose
    sigma: float  # m
    truth: float  # m, the true deviation


class Wait(Struct, frozen=True):
    """A time in which the vehicle waited for a free way."""

    pose: Pose  # true
    seconds: float


class Recording(Struct, kw_only=True):
    """What the picture shows."""

    paths: list[list[Point]] = field(default_factory=list)  # true, of each round
    beliefs: list[tuple[Point, Covariance]] = field(default_factory=list)
    used: list[Point] = field(default_factory=list)
    refused: list[Point] = field(default_factory=list)
    samples: list[Sample] = field(default_factory=list)
    waits: list[Wait] = field(default_factory=list)
    person: Point | None = None
    at_home: int = 0  # rounds
    problems: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The run in a sentence."""
        truth = max((each.truth for each in self.samples), default=0.0)
        return (
            f"{self.at_home} of {len(self.paths)} rounds ended at home; "
            f"{len(self.refused)} of {len(self.used) + len(self.refused)} fixes were refused; "
            f"the vehicle waited {sum(each.seconds for each in self.waits):.0f} s for a person; "
            f"it was {truth:.2f} m beside the route at most."
        )


def yard() -> Scene:
    """Return a yard with a building, and the route around it."""
    curve = [
        moved(Pose(TURN, LOW, 0.0), Twist(1.0, 1 / RADIUS), at * SPACING)
        for at in range(1, math.ceil(RADIUS * math.pi / SPACING))
    ]
    half = len(curve) // 2
    points = (
        m.RoutePoint(x=LEFT, y=LOW, station="home"),
        m.RoutePoint(x=TURN, y=LOW),
        *(m.RoutePoint(x=at.x, y=at.y) for at in curve[:half]),
        m.RoutePoint(x=curve[half].x, y=curve[half].y, station="gate", stay=3.0),
        *(m.RoutePoint(x=at.x, y=at.y) for at in curve[half + 1 :]),
        m.RoutePoint(x=TURN, y=HIGH),
        m.RoutePoint(x=5.2, y=HIGH, station="store", stay=3.0),
        m.RoutePoint(x=LEFT, y=5.6),
        m.RoutePoint(x=LEFT, y=LOW),
    )
    walls = (Wall(points=((0, 0), (16, 0), (16, 10), (0, 10), (0, 0))),)
    return Scene(
        plan=Plan(
            title="a yard",
            start=Spot(x=LEFT, y=LOW),
            walls=walls,
            boxes=(Box(name="building", x=8.1, y=5.0, length=5.4, width=1.6),),
        ),
        route=m.Route(name=NAME, robot=ROBOT, speed=0.7, points=points),
        source=FixModel(period=5, sigma=0.08, heading_sigma=0.03, delay=3, outliers=0.05, gap=100),
        people=(Person(at=34.0, ahead=2.2, speed=0.0, seconds=12.0),),
        incidents={},
    )


class RecordedRun:
    """The run under way: ``recording`` is what has been seen."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        assert scene.source is not None
        self.recording = Recording()
        self._people = list(scene.people)  # they come in the second round
        self._robot = Robot(Draw(SEED, dict(WORN)), scene, folder)
        self._judge = Judge(self._robot, scene.route)
        self._chance = random.Random(SEED)
        self._fixes = FixSource(scene.source, self._robot, self._chance)
        self._tick = 0
        self._refusals = 0
        self._wait: tuple[Pose, int] | None = None  # where, and since when
        hand = self._robot.hand
        hand.subscribe(keys.FIX, self._on_fix, source=SOURCE, depth=4)
        hand.subscribe(keys.MAP_POSE, self._on_pose)
        hand.subscribe(keys.PATROL, self._on_state, depth=16)

    def drive(self, rounds: int) -> Recording:
        """Place the vehicle and drive."""
        self._run(READY_MS)
        request = place_request(self._robot, self._chance, PLACED_SIGMA)
        self._robot.ask("localization", keys.PLACE, request)
        for number in range(rounds):
            self._run(READY_MS)
            self._round(number)
        self.recording.problems += self._judge.violations + self._robot.oracle.violations
        return self.recording

    def _round(self, number: int) -> None:
        answer = self._robot.act("start", NAME)
        if not answer.done:
            self.recording.problems.append(answer.text)
            return
        self._judge.resumed()
        self.recording.paths.append([])
        began_ns, state = self._robot.net.now_ns, None
        while (passed_s := (self._robot.net.now_ns - began_ns) / NS_PER_S) < LONGEST_S:
            if number and self._people and passed_s >= self._people[0].at:
                self._appear(self._people.pop(0))
            self._run(TICK_MS)
            state = self._judge.state
            if state is not None and state.state in {"done", "stopped", "paused"}:
                break
        if state is not None and state.phrases[0].name == "patrol.home":
            self.recording.at_home += 1
        else:
            self.recording.problems.append(
                f"round {number + 1}: {state.text if state else 'silent'}"
            )

    def _appear(self, person: Person) -> None:
        truth = self._robot.vehicle.simulation.pose
        x, y = Pose(truth.x, truth.y, truth.heading).outward(person.ahead, 0.0)
        self.recording.person = x, y
        self._robot.vehicle.inject(
            q.Person(x=x, y=y, heading=truth.heading, speed=person.speed, seconds=person.seconds)
        )

    def _run(self, duration_ms: int) -> None:
        for _ in range(duration_ms // TICK_MS):
            self._fixes.measure(self._tick)
            self._tick += 1
            for _ in range(TICK_MS // LOOK_MS):
                self._robot.run(LOOK_MS)
                self._judge.look()
            if self.recording.paths:
                truth = self._robot.vehicle.simulation.pose
                self.recording.paths[-1].append((truth.x, truth.y))

    # --- messages ---------------------------------------------------------------------------

    def _on_fix(self, arrival: Any) -> None:
        if self.recording.paths:
            self.recording.used.append((arrival.message.x, arrival.message.y))

    def _on_pose(self, arrival: Any) -> None:
        pose: m.MapPose = arrival.message
        refusals = sum(each.refused for each in pose.sources)
        if refusals > self._refusals and self.recording.used:
            self.recording.refused.append(
                self.recording.used.pop()
            )  # there is one fix in 100 ms at most
        self._refusals = refusals
        if pose.x is not None and pose.y is not None and pose.pose_covariance is not None:
            there = (
                self.recording.beliefs[-1][0] if self.recording.beliefs else (math.inf, math.inf)
            )
            if self.recording.paths and math.dist(there, (pose.x, pose.y)) >= APART:
                covariance = Covariance.of(pose.pose_covariance)
                self.recording.beliefs.append(((pose.x, pose.y), covariance))

    def _on_state(self, arrival: Any) -> None:
        state: m.PatrolState = arrival.message
        self._watch(state.state == "waiting")
        if state.state in MOVING and state.deviation is not None and state.sigma is not None:
            self.recording.samples.append(
                Sample(
                    round=len(self.recording.paths),
                    progress=state.progress or 0.0,
                    deviation=state.deviation,
                    sigma=state.sigma,
                    truth=self._judge.from_route,
                )
            )

    def _watch(self, waits: bool) -> None:
        """Note where a wait begins, and its length when it is over."""
        now_ns = self._robot.net.now_ns
        if waits and self._wait is None:
            truth = self._robot.vehicle.simulation.pose
            self._wait = Pose(truth.x, truth.y, truth.heading), now_ns
        elif self._wait is not None and not waits:
            pose, began_ns = self._wait
            self.recording.waits.append(Wait(pose, (now_ns - began_ns) / NS_PER_S))
            self._wait = None


def main(argv: Sequence[str] | None = None) -> int:
    """Drive and draw; return 1 when something is broken."""
    parser = argparse.ArgumentParser(prog="verification.patrol.picture", description=__doc__)
    parser.add_argument("out", type=Path, metavar="OUT.png", help="the picture")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_args(argv)
    from verification.patrol import plot

    scene = yard()
    with tempfile.TemporaryDirectory() as folder:
        recording = RecordedRun(scene, Path(folder)).drive(options.rounds)
    plot.save(options.out, scene, recording)
    print(recording.text, *recording.problems, sep="\n")
    return int(bool(recording.problems) or recording.at_home < options.rounds)


if __name__ == "__main__":
    sys.exit(main())
