"""Unkind motors and a slope, each permitted by the manual: group 21."""

import math
import time

from verification.outside.board import Faults
from verification.outside.course import COURSE, Findings, course, stands, text
from verification.outside.stack import wait_for
from verification.outside.testbed import Result, Testbed, fitted, scenario, seconds
from verification.outside.vehicle import Motors

SLOPE = math.radians(2)
SPEED = 0.4  # m/s
LIMIT_S = SPEED / 0.6 + 0.5  # by the shipped settings
ROLLED_M = 0.20  # no standstill was confirmed before, so that the time limit counts
NOISE_S = 0.3


@scenario(
    21,
    "0.12 s of dead time, 0.15 s of lag, BRAKE takes 3 m/s2",
    COURSE,
    prepare=fitted(Motors(dead_time=0.12, lag=0.15), brake=3.0),
)
def profile_slow_motors(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(
    21,
    "no side moves slower than 0.06 m/s; 0.05 m/s and 0.1 rad/s are requested after the course",
    COURSE + "; nothing is latched by what has no effect",
    prepare=fitted(Motors(dead_zone=0.06)),
)
def profile_dead_zone(bed: Testbed) -> Result:
    found = course(bed)
    bed.board.wall = None
    time.sleep(0.5)
    found.add("reset", bed.operator.reset())
    bed.arm(5.0)
    with bed.source() as source:
        for request in ((0.05, 0.0), (0.0, 0.1)):
            source.request(*request)
            time.sleep(2.0)
    latched = ", ".join(bed.observer.latched)
    found.add(f"without effect: {latched or 'nothing latched'}", not latched)
    return found.result()


@scenario(
    21,
    "the right side is 4 % faster than the left one",
    COURSE,
    prepare=fitted(Motors(left=0.98, right=1.02)),
)
def profile_uneven_sides(bed: Testbed) -> Result:
    return course(bed).result()


@scenario(
    21,
    "one left wheel lacks 30 % of its speed and force",
    COURSE,
    prepare=fitted(Motors(left=0.85)),
)
def profile_weak_wheel(bed: Testbed) -> Result:
    bed.board.vehicle.acceleration *= 0.925
    bed.board.vehicle.deceleration *= 0.925
    return course(bed).result()


@scenario(
    21,
    "let go on a slope of 2 degrees: STOP comes to rest, then the vehicle rolls",
    f"BRAKE within v / a + 0.5 s ({LIMIT_S:.2f} s), {ROLLED_M * 100:.0f} cm at most; drives on "
    "after a reset",
)
def profile_slope(bed: Testbed) -> Result:
    found, vehicle = Findings([], []), bed.board.vehicle
    with bed.source() as source:
        bed.drive(source, SPEED)
        vehicle.motors = Motors(slope=SLOPE)
        at = time.monotonic()
        source.silence()
    wait_for(lambda: vehicle.linear < 0.01, 3.0)
    rest = vehicle.distance
    brake = bed.first("brake", at, 5.0)
    time.sleep(1.5)
    rolled = vehicle.distance - rest
    found.add(f"BRAKE {seconds(brake)} after letting go, rolled {rolled * 100:.1f} cm",
              brake is not None and brake <= LIMIT_S + NOISE_S and rolled <= ROLLED_M
              and vehicle.linear == 0)  # fmt: skip
    found.add(f"latched: {', '.join(bed.observer.latched) or 'nothing'}", good=True)
    done = bed.operator.reset()
    found.add("reset" if done else f"no reset: {text(bed)}", done)
    with bed.source() as source:
        source.request(0.3)
        moves = wait_for(lambda: vehicle.linear > 0.25, 4.0)
        time.sleep(2.0)
        held = abs(vehicle.linear - 0.3) < 0.05
    found.add("drives on" if moves and held else f"does not drive: {text(bed)}", moves and held)
    return found.result()


@scenario(
    21,
    "velocities with noise of 0.015 m/s and 0.02 rad/s and a bias; standing for 15 s after a reset",
    COURSE + "; nothing is latched at standstill",
    faults=lambda: Faults(noise=(0.015, 0.02), bias=(0.005, 0.01)),
)
def profile_noisy_velocity(bed: Testbed) -> Result:
    found = course(bed)
    bed.board.wall = None
    time.sleep(0.5)
    done = bed.operator.reset()
    found.add("reset" if done else f"no reset: {text(bed)}", done)
    time.sleep(15.0)
    latched = ", ".join(bed.observer.latched)
    found.add(f"standing: {latched or 'nothing latched'}", not latched or not done)
    return found.result()


@scenario(
    21,
    "counters with 0.8 % of the distance and 1 % of the turn too much, as of worn wheels",
    COURSE + "; odometry is off by no more than three of its standard deviations",
    faults=lambda: Faults(counts=(1.008, 1.01)),
)
def profile_worn_wheels(bed: Testbed) -> Result:
    found = course(bed)
    estimate = bed.observer.last("tel/odom/odometry")
    error = math.hypot(estimate["x"], estimate["y"]) - bed.board.vehicle.distance
    deviation = math.sqrt(estimate["pose_covariance"][0])
    found.add(f"odometry is off by {error * 100:.1f} cm, {deviation * 100:.1f} cm is its deviation",
              abs(error) < 3 * deviation)  # fmt: skip
    return found.result()


@scenario(
    21,
    "commands turn by 0.001 rad/s, feedback counts 0.1 deg/s, and the stack knows",
    COURSE + "; 0.4 rad/s turns at 0.4 rad/s",
    sets=("wire.command_angular_unit=milliradian",),
)
def profile_unlike_units(bed: Testbed) -> Result:
    bed.board.command_unit = 1000.0
    vehicle = bed.board.vehicle
    with bed.source() as source:
        source.request(0.0, 0.4)
        time.sleep(3.0)
        rate = vehicle.angular
    found = Findings([], [])
    found.add(f"turns at {rate:.2f} rad/s", abs(rate - 0.4) < 0.02)
    stands(bed)
    rest = course(bed)
    return Findings(found.texts + rest.texts, found.wrong + rest.wrong).result()
