"""Supervision of a motion: its end, and each contradiction, by synthetic messages."""

import math
from dataclasses import dataclass

import pytest
from msgspec.structs import replace

from cli.commission.manoeuvres import STEADY_S, Manoeuvre, plan
from cli.commission.supervision import Supervision
from common.freshness import NS_PER_S, Latest
from common.motion import STILL, Twist
from services.safety.config import SafetyConfig
from t2.messages import Command, Mileage, Motion, Velocity

PERIOD_S = 0.02


def manoeuvre(start: str) -> Manoeuvre:
    return next(it for it in plan(SafetyConfig()) if it.title.startswith(start))


FORWARD, BACKWARD = manoeuvre("STOP forward from 0.50"), manoeuvre("STOP backward from 0.50")
LEFT, CURVE = manoeuvre("STOP left from 0.50"), manoeuvre("STOP forward turning left")
FULL_TURN = manoeuvre("Full turn")


@dataclass(frozen=True)
class Vehicle:
    """A vehicle that has its speed at once; factors of the request."""

    counted: float = 1.0
    measured: float = 1.0
    aside: Twist = STILL  # m/s and rad/s that nobody requests
    granted: float = 1.0
    spike: float = 0.0  # m/s, a single velocity after 0.5 s
    ripple: float = 0.0  # share of the speed, at each second velocity
    rising: float = 0.0  # share of the speed per second

    def drive(self, it: Manoeuvre, seconds: float) -> tuple[Supervision, str, float]:
        """Return the supervision, how the motion ended, and after how many seconds."""
        supervision = Supervision(it)
        logs: tuple[list[Latest[Motion]], list[Latest[Velocity]], list[Latest[Mileage]]]
        logs = [], [], []
        way = Twist(100.0, 3.0)  # the heading wraps on the way
        for number in range(round(seconds / PERIOD_S)):
            at_s = number * PERIOD_S
            self._add(logs, it.twist, way, number)
            assert supervision.take(*logs)
            assert not supervision.take(*logs)
            for found, how in (
                (supervision.problem(), "problem"),
                (supervision.is_at_limit, "limit"),
                (supervision.is_steady(logs[1]), "steady"),
            ):
                if found:
                    return supervision, how, at_s
            true = Twist(it.twist.linear + self.aside.linear, it.twist.angular + self.aside.angular)
            way = Twist(
                way.linear + true.linear * self.counted * PERIOD_S,
                way.angular + true.angular * self.counted * PERIOD_S,
            )
        return supervision, "", seconds

    def _add(self, logs, asked: Twist, way: Twist, number: int) -> None:  # type: ignore[no-untyped-def]
        now_ns = number * round(PERIOD_S * NS_PER_S) + NS_PER_S
        wavy = 1 + self.ripple * (-1) ** number + self.rising * number * PERIOD_S
        speed = asked.scaled(self.measured * wavy)
        linear = speed.linear + self.aside.linear + self.spike * (number == 25)
        motion = Motion(
            command=Command.RUN, linear=asked.linear * self.granted,
            angular=asked.angular * self.granted, mono_ns=now_ns,
        )  # fmt: skip
        logs[0].append(Latest(motion, now_ns))
        velocity = Velocity(
            linear=linear, angular=speed.angular + self.aside.angular, mono_ns=now_ns
        )
        logs[1].append(Latest(velocity, now_ns))
        heading = math.remainder(way.angular, math.tau)
        mileage = Mileage(distance=way.linear, heading=heading, epoch=0, mono_ns=now_ns)
        logs[2].append(Latest(mileage, now_ns))


def both(factor: float) -> Vehicle:
    return Vehicle(counted=factor, measured=factor)


@pytest.mark.parametrize("it", [FORWARD, BACKWARD, LEFT, CURVE])
def test_a_steady_speed_ends_it(it: Manoeuvre) -> None:
    _, how, after_s = Vehicle().drive(it, 5.0)
    assert how == "steady"
    assert after_s == pytest.approx(STEADY_S)
    _, how, _ = Vehicle(ripple=0.2).drive(it, 5.0)
    assert how == "steady"


@pytest.mark.parametrize(
    ("it", "vehicle", "reached"),
    [
        (FORWARD, Vehicle(granted=0.9), 0.975),  # m
        (FORWARD, Vehicle(rising=0.2), 0.975),
        (FORWARD, Vehicle(granted=0.9, counted=1.25), 0.975),
        (BACKWARD, Vehicle(granted=0.9, measured=1.25), 0.975),
        (LEFT, Vehicle(granted=0.9), 0.725),  # rad
        (CURVE, Vehicle(granted=0.9), 0.72),
        (FULL_TURN, Vehicle(), 6.163),
    ],
)
def test_a_limit_ends_it(it: Manoeuvre, vehicle: Vehicle, reached: float) -> None:
    supervision, how, _ = vehicle.drive(it, 30.0)
    assert how == "limit"
    travel = supervision.travel
    largest = max(
        abs(value)
        for way in (travel.counted, travel.integrated)
        for value in ((way.angular,) if it.is_turn or it is CURVE else (way.linear,))
    )
    assert reached <= largest < reached + 0.05


@pytest.mark.parametrize(
    ("it", "vehicle", "text", "then"),
    [
        (FORWARD, both(-1.0), "Wrong sign: by the counters it has travelled -0.03 m on a", "end"),
        (BACKWARD, both(-1.0), "on a request of -0.50 m/s.", "end"),
        (FORWARD, Vehicle(measured=-1.0), "by the velocities it has travelled -0.04 m", "end"),
        (LEFT, both(-1.0), "it has turned -0.06 rad on a request of +0.50", "end"),
        (FORWARD, both(1.35), "Too fast: the board measures 0.68 m/s, requested are 0.50", "end"),
        (BACKWARD, both(1.35), "check the board's scale of the speed.", "end"),
        (LEFT, both(1.745), "the board measures 0.87 rad/s, requested are 0.50 rad/s: che", "end"),
        (FORWARD, Vehicle(counted=0.6), "differ by 40%: counted +0.", "end"),
        (FORWARD, Vehicle(counted=0.0), "Counters and velocities differ by 100%", "end"),
        (FORWARD, Vehicle(measured=0.6), "Counters and velocities differ by 40%", "end"),
        (LEFT, Vehicle(measured=0.573), "check wire.feedback_angular_unit with", "end"),
        (FORWARD, Vehicle(aside=Twist(0.0, 0.2)), "turned 9 degrees to the left within", "again"),
        (BACKWARD, Vehicle(aside=Twist(0.0, -0.2)), "9 degrees to the right within 0.", "again"),
        (LEFT, Vehicle(aside=Twist(0.2, 0.0)), "it has travelled 0.15 m forward", "again"),
    ],
)
def test_contradictions(it: Manoeuvre, vehicle: Vehicle, text: str, then: str) -> None:
    supervision, how, _ = vehicle.drive(replace_steady(it), 3.0)
    assert how == "problem"
    problem = supervision.problem()
    assert problem is not None
    assert text in problem.text
    assert (problem.then, problem.ending) == (then, "brake")


def replace_steady(it: Manoeuvre) -> Manoeuvre:
    """Return a manoeuvre that a contradiction ends before its steady speed does."""
    return replace(it, steady_s=math.inf, limit=it.limit.scaled(2))


@pytest.mark.parametrize(
    ("it", "vehicle"),
    [
        (FORWARD, both(1.3)),
        (FORWARD, Vehicle(spike=1.0)),  # one wrong velocity
        (FORWARD, Vehicle(counted=1.2)),
        (FORWARD, Vehicle(aside=Twist(0.0, 0.05))),
        (CURVE, both(1.25)),
    ],
)
def test_what_is_tolerated(it: Manoeuvre, vehicle: Vehicle) -> None:
    _, how, _ = vehicle.drive(it, 3.0)
    assert how in ("steady", "limit")


def test_a_restart_of_the_board_is_no_travel() -> None:
    supervision = Supervision(FORWARD)
    for epoch, distance in ((0, 50.0), (1, 0.0), (1, 0.1)):
        supervision.travel.add_mileage(Mileage(distance=distance, heading=0.0, epoch=epoch))
    assert supervision.travel.counted.linear == pytest.approx(0.1)
