"""The lap: a program of the client library ``t2``, written as you would write your own.

The vehicle stops short of a wall, hits a box that no sonar sees, moves off it, and returns to the
start. The world is ``sim/worlds/office.toml``; odometry starts at its origin.
"""

import math
from contextlib import suppress
from dataclasses import dataclass

import t2
from cli.demo.driver import Driver

FAR = 10.0  # m; the room is shorter


@dataclass(frozen=True, slots=True)
class Pace:
    """Speeds of the lap."""

    cruise: float  # m/s
    careful: float  # m/s
    spin: float  # rad/s


QUICK = Pace(0.8, 0.4, 0.8)
# For a host with scheduling stalls: measurements are old when the program acts on them.
PATIENT = Pace(0.5, 0.25, 0.3)


def drive_lap(drive: Driver, pace: Pace, *, fast: bool = False) -> None:
    """Drive the lap; the fast one ends before the way home."""
    step = drive.record.step

    step("wait for safety")
    drive.wait()

    step("drive off to the wall")
    with suppress(t2.Blocked):
        drive.forward(FAR, pace.cruise, expected="blocked")

    step("back off")
    drive.forward(-0.45, pace.careful)

    step("turn left")
    drive.turn(math.pi / 2, pace.spin)

    step("drive on")
    with suppress(t2.Latched):
        drive.forward(FAR, pace.cruise, expected="contact")

    step("reset, refused")
    try:
        drive.robot.reset()
    except t2.T2Error as refusal:  # the bumper is pressed
        drive.record.answer(False, str(refusal))

    step("release")
    drive.release("backward")

    step("reset")
    drive.reset()

    step("back off")
    drive.forward(-0.6, pace.careful)
    if fast:
        return

    step("turn home")
    here = drive.pose()
    drive.turn(wrapped(math.atan2(-here.y, -here.x) - here.heading), pace.spin)

    step("drive home")
    drive.forward(math.hypot(here.x, here.y), pace.cruise)

    step("turn as at the start")
    drive.turn(-drive.pose().heading, pace.spin)


def wrapped(angle: float) -> float:
    """Return an angle within -pi..pi."""
    return math.remainder(angle, math.tau)
