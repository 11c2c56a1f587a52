"""STOP without effect, uncommanded motion, and standstill: groups 4 and 17."""

import time

from verification.outside.board import Faults
from verification.outside.clients import STATE
from verification.outside.testbed import Result, Testbed, scenario, seconds

DECELERATION, ANGULAR_DECELERATION = 0.6, 1.0  # the shipped settings
NOISE_S = 0.3


def ignored(bed: Testbed, linear: float, angular: float) -> Result:
    """Drive, let go, and wait for BRAKE while the board ignores STOP."""
    with bed.source() as source:
        bed.drive(source, linear, angular)
        bed.board.faults.keeps_rolling = True
        let_go = time.monotonic()
        source.silence()
        # What comes first counts: safety may ramp down by RUN frames of its own.
        speed = max(abs(linear) / DECELERATION, abs(angular) / ANGULAR_DECELERATION)
        limit = speed + 0.5 + NOISE_S
        stop = bed.first("stop", let_go, 2.0)
        began = let_go + (stop or 0.0)
        vehicle = bed.board.vehicle
        rolling = abs(vehicle.linear), abs(vehicle.angular)
        brake = bed.first("brake", began, 4.0)
    stops = sum(c.kind == "stop" for c in bed.board.since(let_go))
    causes = bed.observer.causes(let_go) - {"no_request"}
    text = f"BRAKE {seconds(brake)} after STOP at {rolling[0]:.2f} m/s, {rolling[1]:.2f} rad/s"
    text += f"; {stops} STOP; {', '.join(sorted(causes)) or 'no cause'}"
    return Result(text, brake is not None and brake <= limit)


@scenario(
    4, "only BRAKE takes speed away; let go at 0.28 m/s", "BRAKE within v / a + 0.5 s (0.97 s)"
)
def ignores_stop(bed: Testbed) -> Result:
    return ignored(bed, 0.28, 0.0)


@scenario(
    4, "only BRAKE takes speed away; let go at 0.49 rad/s", "BRAKE within v / a + 0.5 s (0.99 s)"
)
def ignores_stop_turning(bed: Testbed) -> Result:
    return ignored(bed, 0.0, 0.49)


def drifts(bed: Testbed, linear: float, angular: float) -> Result:
    """Make the standing vehicle drift, and wait for BRAKE."""
    vehicle = bed.board.vehicle
    time.sleep(1.0)
    distance, heading, at = vehicle.distance, vehicle.heading, time.monotonic()
    bed.board.faults.drift = linear, angular
    brake = bed.first("brake", at, 4.0)
    moved = abs(vehicle.distance - distance), abs(vehicle.heading - heading)
    time.sleep(0.3)
    text = f"BRAKE {seconds(brake)}, {moved[0] * 100:.0f} cm, {moved[1]:.2f} rad away; "
    text += f"latched: {', '.join(bed.observer.latched) or 'nothing'}"
    near = moved[0] <= 0.08 and moved[1] <= 0.10
    ok = brake is not None and near and "uncommanded_motion" in bed.observer.latched
    return Result(text, ok)


@scenario(
    4,
    "a standing vehicle drifts at 0.1 m/s",
    "BRAKE within 5 cm (and 3 cm of reaction), uncommanded_motion latched",
)
def drift(bed: Testbed) -> Result:
    return drifts(bed, 0.1, 0.0)


@scenario(
    4,
    "a standing vehicle drifts at 0.1 rad/s",
    "BRAKE within 0.05 rad (and 0.05 rad of reaction), uncommanded_motion latched",
)
def drift_turning(bed: Testbed) -> Result:
    return drifts(bed, 0.0, 0.1)


@scenario(
    4,
    "only BRAKE takes speed away; safety is killed at 0.28 m/s",
    "BRAKE of the bridge within its lease + v / a + 0.5 s (1.17 s)",
    faults=lambda: Faults(keeps_rolling=True),
)
def ignores_stop_alone(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.28)
        at = time.monotonic()
        bed.stack.kill("safety")
        brake = bed.first("brake", at, 4.0)
    return Result(f"BRAKE {seconds(brake)}", brake is not None and brake <= 1.17 + NOISE_S)


@scenario(
    4,
    "a standing vehicle drifts at 0.1 m/s after safety was killed",
    "BRAKE of the bridge within 5 cm (and 3 cm of reaction)",
)
def drift_alone(bed: Testbed) -> Result:
    bed.stack.kill("safety")
    time.sleep(0.4)
    vehicle = bed.board.vehicle
    distance, at = vehicle.distance, time.monotonic()
    bed.board.faults.drift = 0.1, 0.0
    brake = bed.first("brake", at, 4.0)
    moved = abs(vehicle.distance - distance)
    text = f"BRAKE {seconds(brake)}, {moved * 100:.0f} cm away"
    return Result(text, brake is not None and moved <= 0.08)


@scenario(
    4,
    "eight stops from 0.5 m/s or 0.6 rad/s by a vehicle that slows down at 0.62 m/s2, 1.0 rad/s2",
    "nothing is latched",
)
def ordinary_stops(bed: Testbed) -> Result:
    bed.board.vehicle.deceleration, bed.board.vehicle.angular_ratio = 0.62, 1.65
    at = time.monotonic()
    for linear, angular in ((0.5, 0.0), (0.0, 0.6), (-0.5, 0.0), (0.4, -0.5)) * 2:
        with bed.source() as source:
            bed.drive(source, linear, angular)
            bed.halt(source)
            time.sleep(0.3)
    return unlatched(bed, at)


@scenario(
    4,
    "the board restarts, standing, after 1 m: its counters jump to zero",
    "nothing is latched, and the vehicle can be driven",
)
def counters_jump(bed: Testbed) -> Result:
    at = time.monotonic()
    with bed.source() as source:
        bed.drive(source, 0.5, 0.3)
        time.sleep(2.0)
        bed.halt(source)
    time.sleep(0.5)
    bed.board.restart(0.15)
    time.sleep(1.0)
    bed.arm(5.0)
    with bed.source() as source:
        bed.drive(source, 0.3)
    return unlatched(bed, at)


@scenario(
    4,
    "standing for 20 s; the velocity is off by 2 mm/s and 0.2 deg/s, the counters stand",
    "nothing is latched",
)
def velocity_bias(bed: Testbed) -> Result:
    at = time.monotonic()
    bed.board.faults.bias = 0.002, 0.0035
    time.sleep(20.0)
    return unlatched(bed, at)


def unlatched(bed: Testbed, since: float) -> Result:
    states = bed.observer.since(STATE, since)
    latched = {name for state in states for name in state["latched"]}
    return Result(f"latched: {', '.join(sorted(latched)) or 'nothing'}", not latched)


@scenario(
    17,
    "standing, the counters dither by one step, velocities by 0.03",
    "the heading's variance grows by less than 1e-6 rad2 within 5 s",
)
def standing(bed: Testbed) -> Result:
    bed.board.faults.dither = True
    time.sleep(2.0)
    variances = [bed.observer.last("tel/odom/odometry")["pose_covariance"][8]]
    for _ in range(20):
        time.sleep(0.25)
        variances.append(bed.observer.last("tel/odom/odometry")["pose_covariance"][8])
    grown = min(variances[-5:]) - max(variances[:1])
    return Result(f"grows by {grown:.1e} rad2", grown < 1e-6)
