"""Random drives through the simulated office, without a bus and in simulated time.

``python -m verification.vehicles.wander`` prints the share of time in motion, for simulated sonars
and for sonars that saturate at a shorter range. A contact is counted, and the vehicle is put back
to its pose one second before.
"""

import math
import random
import statistics
import sys
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import msgspec
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import (
    Bumper,
    Drive,
    Driver,
    Link,
    Message,
    Mileage,
    Switches,
    Velocity,
)
from common.motion import STILL, Command, Twist
from common.settings import Vehicle, Wire
from common.wire.commands import MotionKind
from common.wire.reports import UltrasonicReport
from services.bridge.translate import Translator
from services.safety.config import Safety
from services.safety.inputs import DriveRequest, Event, Inputs
from services.safety.policy import Policy
from sim.config import Drive as Motors
from sim.config import Sonar as SonarSettings
from sim.geometry import Rectangle
from sim.sonar import Sonars
from sim.vehicle import move, next_twist
from sim.world import Plan, World

OFFICE = Path(__file__).parents[2] / "sim/worlds/office.toml"
TICK_NS, SONAR_TICKS, ASK_TICKS = NS_PER_S // 100, 5, 5
BACK_TICKS = 100  # how far a contact puts the vehicle back
KINDS = {
    Command.RUN: MotionKind.RUN,
    Command.STOP: MotionKind.STOP,
    Command.BRAKE: MotionKind.BREAK,
}
LINK = Link(
    state="up", board="", epoch=0, armed=True, waiting="", rates={}, rejected={}, round_trip=None
)
EVERY_WAY = [
    Twist(linear, angular)
    for linear in (0.3, -0.3, 0.0)
    for angular in (0.0, 0.4, -0.4)
    if linear or angular
]


@dataclass(frozen=True, slots=True)
class Figures:
    """The result of one run."""

    moving: float  # share of the time
    metres: float
    contacts: int
    immobile: bool  # at the end no request moves it


class Walk:
    """One vehicle in the office with a random operator."""

    def __init__(self, seed: int, saturation: float = 5.0, noise: float = 0.005) -> None:
        plan = msgspec.toml.decode(OFFICE.read_bytes(), type=Plan)
        vehicle = Vehicle()
        self.world = World.of(plan).without("step")
        self.body = Rectangle(vehicle.length / 2, vehicle.width / 2)
        self.pose, self.twist, self.contacts = plan.start.pose, STILL, 0
        sonars = replace(vehicle, sonar_max=saturation)
        self.sonars = Sonars(sonars, SonarSettings(noise=noise), seed)
        self.random = random.Random(seed)
        self.policy = Policy(Safety(), vehicle)
        self.state = self.policy.start()
        self.translator = Translator(Wire(), vehicle, 1.0, 1.0)
        self.inputs = Inputs(estop_connection=1)
        self.now_ns, self.ticks = 10 * NS_PER_S, 0
        self.distance = self.turn = self.metres = 0.0
        self.before = deque([self.pose], maxlen=BACK_TICKS)
        self.asked, self.until_ns, self.blocked_ns = STILL, 0, 0

    def tick(self, asked: Twist | None) -> bool:
        """Simulate 10 ms with a request; return whether the vehicle moves."""
        self.now_ns += TICK_NS
        self.ticks += 1
        self._move()
        self._report()
        self.state = replace(self.state, heartbeat=self.state.heartbeat.beat(self.now_ns))
        self._decide(None)
        if asked is not None and self.ticks % ASK_TICKS == 0:
            drive = Drive(
                linear=asked.linear,
                angular=asked.angular,
                echo=self.state.heartbeat.number,
                seq=self.ticks,
                boot=1,
            )
            self._decide(DriveRequest("teleop", drive, self.now_ns))
        return abs(self.twist.linear) > 0.02 or abs(self.twist.angular) > 0.05

    def wander(self, seconds: float) -> float:
        """Drive randomly; return the share of time in motion."""
        ticks = round(seconds * NS_PER_S / TICK_NS)
        return sum(self.tick(self._choose()) for _ in range(ticks)) / ticks

    def is_immobile(self) -> bool:
        """Request every direction for some time; return whether none moves the vehicle."""
        for way in EVERY_WAY:
            for _ in range(50):
                self.tick(STILL)
            if sum(self.tick(way) for _ in range(150)) > 20:
                return False
        return True

    def _choose(self) -> Twist:
        """Keep the request for some time; choose another one soon when blocked."""
        blocked = "blocked" in self.state.latches
        self.blocked_ns = self.blocked_ns + TICK_NS if blocked else 0
        if self.now_ns >= self.until_ns or self.blocked_ns > NS_PER_S // 2:
            self.until_ns = self.now_ns + round(self.random.uniform(1.0, 4.0) * NS_PER_S)
            self.blocked_ns = 0
            linear = self.random.choice((0.7, 0.5, 0.3, 0.0, -0.3))
            self.asked = Twist(linear, self.random.choice((0.0, self.random.uniform(-0.8, 0.8))))
            return STILL
        return self.asked

    def _move(self) -> None:
        verdict, dt = self.state.verdict, TICK_NS / NS_PER_S
        target = Twist(verdict.twist.linear, verdict.twist.angular)
        twist = next_twist(self.twist, KINDS[verdict.command], target, Motors(), dt)
        way = move(self.pose, twist, dt, lambda pose: self.world.blocks(self.body, pose))
        self.before.append(self.pose)
        self.pose, self.twist = way.pose, STILL if way.held else twist
        self.distance += way.distance
        self.metres += abs(way.distance)
        self.turn += way.turn
        if self.world.contact(self.body, self.pose):
            self.contacts += 1
            self.pose, self.twist = self.before[0], STILL

    def _report(self) -> None:
        self._put("velocity", Velocity(linear=self.twist.linear, angular=self.twist.angular))
        heading = math.remainder(self.turn, math.tau)
        self._put("mileage", Mileage(distance=self.distance, heading=heading, epoch=0))
        self._put("bumper", Bumper(pressed=False))
        for side in ("left", "right"):
            self._put(side, Driver(faults=(), bits=0))
        self._put("switches", Switches(ultrasonic_brake=True, bumper_brake=True))
        self._put("link", LINK)
        if self.ticks % SONAR_TICKS == 0:
            report = UltrasonicReport(self.sonars.measure(self.world, self.pose))
            self._put("ultrasonic", self.translator.ultrasonic(report))

    def _put(self, name: str, message: Message) -> None:
        stamped = msgspec.structs.replace(message, seq=self.ticks, boot=2)
        if hasattr(self.inputs, name):
            self.inputs = replace(self.inputs, **{name: Latest(stamped, self.now_ns)})

    def _decide(self, event: Event | None) -> None:
        inputs = replace(self.inputs, event=event)
        self.state, _ = self.policy.decide(self.state, inputs, self.now_ns)


def run(seed: int, saturation: float, seconds: float = 60.0, noise: float = 0.005) -> Figures:
    """Run one random drive."""
    walk = Walk(seed, saturation, noise)
    moving = walk.wander(seconds)
    metres, contacts = walk.metres, walk.contacts
    return Figures(moving, metres, contacts, walk.is_immobile())


def main(seeds: int = 6) -> None:
    """Print the figures."""
    for saturation in (5.0, 4.5, 3.0):
        runs = [run(seed, saturation) for seed in range(seeds)]
        moving = statistics.mean(one.moving for one in runs)
        metres = statistics.mean(one.metres for one in runs)
        contacts = sum(one.contacts for one in runs)
        stuck = sum(one.immobile for one in runs)
        sys.stdout.write(
            f"sonars saturate at {saturation} m: moves {moving:.0%} of the time, {metres:.1f} m, "
            f"{contacts} contacts, immobile at the end in {stuck} of {seeds} runs\n"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
