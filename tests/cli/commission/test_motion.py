"""Motions with their three measurements: commands, velocities and the board's counters."""

import math
from dataclasses import dataclass, replace
from typing import Any

import pytest

from cli.commission.motion import (
    RATIO,
    SETTLE_NS,
    WINDOW_NS,
    Run,
    judge_motion,
    measure,
    stood_after_s,
    too_fast,
)
from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from t2.messages import Command, Mileage, Motion, Velocity
from tests.factories import safety_state

FORWARD, LEFT = Twist(linear=0.1), Twist(angular=0.2)
PERIOD_NS = NS_PER_S // 50
MRAD = 0.001 / math.radians(0.1)  # 0.573: the ratio for a firmware with milliradians


@dataclass(frozen=True)
class Vehicle:
    """Simulated vehicle; its responses are factors of the command."""

    counted: float = 1.0
    measured: float = 1.0
    driven_s: float = 2.0
    granted: float = 1.0  # by safety
    starts_at: float = 3.1  # heading, rad: it wraps on the way
    stands_after_s: float = 0.2
    unit: str = "decidegree"
    feedback: str = "decidegree"

    def run(self, requested: Twist) -> Run:
        end_ns = round(self.driven_s * NS_PER_S)
        stand_ns = end_ns + round(self.stands_after_s * NS_PER_S)
        asked = Motion(
            command=Command.RUN,
            linear=requested.linear * self.granted,
            angular=requested.angular * self.granted,
        )
        motions, velocities, mileages = [], [], []
        for t in range(0, end_ns + NS_PER_S, PERIOD_NS):
            motions.append(Latest(asked if t <= end_ns else Motion(command=Command.RUN), t))
            moving = self.measured * (t <= stand_ns)
            linear, angular = asked.linear * moving, asked.angular * moving
            velocities.append(Latest(Velocity(linear=linear, angular=angular), t))
            counted = self.counted * min(t, end_ns) / NS_PER_S
            heading = math.remainder(self.starts_at + asked.angular * counted, math.tau)
            distance = asked.linear * counted
            counts = Mileage(distance=distance, heading=heading, epoch=0, mono_ns=t)
            mileages.append(Latest(counts, t))
        states = [
            Latest(safety_state(verdict="stop", text="blocked"), 0),
            Latest(safety_state(verdict="run"), 1),
        ]
        units = self.unit, self.feedback
        return Run(requested, *units, end_ns, motions, velocities, mileages, states)


def both(factor: float, **more: Any) -> Vehicle:
    return Vehicle(counted=factor, measured=factor, **more)


def test_a_good_vehicle_passes() -> None:
    verdict = judge_motion(Vehicle().run(LEFT))
    assert verdict.outcome == "passed", verdict
    assert dict(verdict.data)["counted / commanded"] == "1.000"
    assert dict(verdict.data)["standstill after"] == "0.22 s"


COMMAND, FEEDBACK = "set wire.command_angular_unit = ", "set wire.feedback_angular_unit = "


@pytest.mark.parametrize(
    ("requested", "vehicle", "phrase"),
    [
        (FORWARD, both(1 + RATIO - 0.01), ""),
        (FORWARD, both(1 + RATIO + 0.01), "It goes 1.26 times as fast as commanded."),
        (FORWARD, both(0.0), "No motion: neither the velocity nor the di"),
        (FORWARD, Vehicle(counted=0.0), "but the distance does not."),
        (LEFT, Vehicle(counted=0.0), "a gyroscope counts only on the ground."),
        (FORWARD, both(-1.0), "The sign is wrong: on a positive command"),
        (LEFT, both(-1.0), "it goes clockwise."),
        (FORWARD, Vehicle(measured=-1.0), "The measured velocity has the wrong sign"),
        (FORWARD, Vehicle(measured=2.0), "2.00 times the velocity of the counter."),
        (FORWARD, Vehicle(stands_after_s=5.0), "It did not stand within 2 s"),
        (FORWARD, Vehicle(granted=0.5), "Measured at most 0.05 m/s of 0.10 requested. Safety rep"),
        # The firmware uses one unit for both directions, so its feedback looks correct.
        (LEFT, Vehicle(counted=MRAD), f'{COMMAND}"milliradian"'),
        (LEFT, Vehicle(counted=3.0), "It goes 3.00 times as fast as commanded."),
        # The counter shows the unit of the feedback.
        (LEFT, Vehicle(measured=1 / MRAD), f'{FEEDBACK}"milliradian"'),
        (LEFT, Vehicle(measured=MRAD, feedback="milliradian"), f'{FEEDBACK}"decidegree"'),
        (LEFT, Vehicle(measured=0.0), "velocity is 0.00 times the velocity of the counter."),
    ],
)
def test_problems_are_named(requested: Twist, vehicle: Vehicle, phrase: str) -> None:
    verdict = judge_motion(vehicle.run(requested))
    assert verdict.outcome == ("failed" if phrase else "passed")
    assert phrase in verdict.text
    assert (COMMAND in verdict.text) == (COMMAND in phrase)


def test_the_window_must_be_long_enough() -> None:
    shortest_s = (SETTLE_NS + WINDOW_NS) / NS_PER_S
    assert measure(Vehicle(driven_s=shortest_s).run(FORWARD)) is not None
    assert measure(Vehicle(driven_s=shortest_s - 0.02).run(FORWARD)) is None


def test_no_measurement_across_a_pause_or_without_messages() -> None:
    run = Vehicle().run(FORWARD)
    pause = Latest(Motion(command=Command.STOP), NS_PER_S)
    motions = sorted([*run.motions, pause], key=lambda motion: motion.received_ns)
    assert measure(replace(run, motions=motions)) is None
    assert measure(replace(run, velocities=[])) is None
    assert measure(replace(run, mileages=run.mileages[:1])) is None
    verdict = judge_motion(replace(run, motions=[], velocities=[], mileages=[], states=[]))
    assert verdict.data == (("standstill after", "never"),)


def test_no_standstill_if_it_moves_again() -> None:
    run = Vehicle().run(FORWARD)
    again = Latest(Velocity(linear=0.1, angular=0.0), run.velocities[-1].received_ns + 1)
    assert stood_after_s(replace(run, velocities=[*run.velocities, again])) is None


@pytest.mark.parametrize(
    ("requested", "linear", "angular", "ends"),
    [
        (FORWARD, 0.3, 0.0, False),
        (FORWARD, -0.31, 0.0, True),
        (LEFT, 0.0, 0.6, False),
        (LEFT, 0.31, 0.0, True),
    ],
)
def test_three_times_the_requested_speed_ends_it(
    requested: Twist, linear: float, angular: float, ends: bool
) -> None:
    assert too_fast(requested, Velocity(linear=linear, angular=angular)) is ends
