"""What the parameters of a simulated vehicle say, beside what ``t2 fit`` has found. Pure.

A proposal is on the safe side if safety reckons with at least the distance that the vehicle needs,
in each direction and from each speed, as the simulator's motors take it. The truth of an estimate
is a parameter of ``sim.model``; motors with lag have no deceleration, so they are left out.
"""

from collections.abc import Iterator
from math import ceil
from statistics import mean

from cli.fit.fit import ANGULAR, DECELERATION, REACT, SENSING_S, Fit
from common.motion import STANDING_MPS, STANDING_RADPS, Twist
from common.wire.commands import MotionKind
from services.safety.config import DECISION_PERIOD_S
from sim.model import Model
from sim.vehicle import WHEELS, Motors

SPEEDS = (0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0)  # of the greatest allowed speed
STEP_S, STEADY, LONGEST = 0.01, 100, 3000  # of the simulated motors; steps
SHARES = 100  # of the jitter
LITTLE = 0.002  # m or rad: steps of the counters
SPAN = {"forward": 1, "backward": -1, "left": 1, "right": -1}


def unsafe(found: Fit, model: Model) -> list[str]:
    """Return the stops that need more than safety reckons with, by the proposed settings."""
    if REACT not in found.proposals:
        return []
    wait_s = float(found.proposals[REACT]) + DECISION_PERIOD_S
    delay_s = max(late_s(model))
    body, short = found.settings.vehicle, []
    for share in SPEEDS:
        for direction, sign in SPAN.items():
            turns = direction in ("left", "right")
            speed = share * (body.max_angular if turns else body.max_linear)
            twist = Twist(0.0, sign * speed) if turns else Twist(sign * speed, 0.0)
            deceleration = float(found.proposals[ANGULAR if turns else DECELERATION])
            reckoned = speed * (wait_s + speed / deceleration / 2)
            waits = SENSING_S + DECISION_PERIOD_S + delay_s
            needed = stopped_within(twist, model, body.track) + speed * waits
            if needed > reckoned + LITTLE:
                short.append(f"{direction} from {speed:g}: {needed:.3f} of {reckoned:.3f}")
    return short


def stopped_within(twist: Twist, model: Model, track: float) -> float:
    """Return the distance (m, or rad of a turn) from a STOP at the board to standstill."""
    motors, distance = Motors(model.drive, track), 0.0
    for _ in range(STEADY):
        motors.follow(twist, MotionKind.RUN, twist, STEP_S)
    turns = bool(twist.angular)
    for _ in range(LONGEST):
        twist = motors.follow(twist, MotionKind.STOP, Twist(), STEP_S)
        speed = abs(twist.angular if turns else twist.linear)
        if speed < (STANDING_RADPS if turns else STANDING_MPS):
            break  # on a slope the vehicle may roll on: that is no part of the stop
        distance += speed * STEP_S
    return distance


def truths(model: Model) -> Iterator[tuple[str, float]]:
    """Yield the names of estimates with their true values."""
    drive = model.drive
    force = 1 - drive.weak_wheel / WHEELS
    seen_s = round(drive.dead_time / STEP_S) * STEP_S + mean(late_s(model))
    if not drive.lag:
        for direction in SPAN:
            turns = direction in ("left", "right")
            deceleration = force * (drive.angular_coast if turns else drive.coast)
            yield f"STOP {direction}: deceleration", deceleration
            yield f"STOP {direction}: reaction", seen_s
    yield "speed at standstill, bias", model.velocity.bias
    if model.sonar.saturation < model.vehicle.sonar_max:
        yield "sonars, greatest reading", model.sonar.saturation


def late_s(model: Model) -> list[float]:
    """Return how late a velocity may show a command, by the cable both ways, in equal shares.

    The simulator delivers a datagram at the end of a step. A line with one bad port does not count:
    the other one takes over.
    """
    lines = [line for line in (model.cable.to_board, model.cable.to_pc) if line.port == "both"]
    shares = [(n + 1) / SHARES for n in range(SHARES)]
    late = [[ceil((line.delay + n * line.jitter) / STEP_S) for n in shares] for line in lines]
    return [sum(each) * STEP_S for each in zip(*late, strict=True)] or [0.0]
