"""The lap: a program of the client library ``t2``, written as you would write your own.

The vehicle stops short of a wall, hits a box that no sonar sees, moves off it, is reset, and
returns to the start. The world is ``sim/worlds/office.toml``; odometry starts at its origin.

On a host with scheduling stalls safety stops the vehicle now and then. Each motion is repeated
until it is done; a latch that the lap does not expect is reset and counted.
"""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import t2
from t2.messages import Odometry

SOURCE = "demo"  # of ``safety.sources``
OPERATOR = "teleop"  # a program may not move off the bumper; here the lap stands in for an operator
FAR = 10.0  # m; the room is shorter
PATIENCE_S = 1.0  # without progress, until a motion is requested anew
RETRY_S = 0.1
FACING = 0.03  # rad
TURNS_MAX = 3  # old measurements make a turn end late; the next one corrects it
T = TypeVar("T")


class Lap:
    """One lap of a robot at ``pace``, 1.0 or less.

    ``show`` receives each line to print, ``check`` is called before each attempt of a motion, and
    raises to end the lap.
    """

    def __init__(
        self,
        robot: t2.Robot,
        pace: float,
        *,
        show: Callable[[str], object],
        check: Callable[[], object],
    ) -> None:
        self._robot, self._show, self._check = robot, show, check
        self._cruise, self._careful, self._spin = 0.8 * pace, 0.4 * pace, 0.8 * pace
        self._shown = ""

    def drive(self) -> None:
        """Drive the lap."""
        self._print("  wait for safety")
        self._motion(lambda _: None)

        self._print("  drive off to the wall")
        with suppress(t2.Blocked):
            self._forward(FAR, self._cruise, expected="blocked")

        self._print("  back off")
        self._forward(-0.45, self._careful)

        self._print("  turn left")
        self._turn(math.pi / 2)

        self._print("  drive on")
        with suppress(t2.Latched):
            self._forward(FAR, self._cruise, expected="contact")

        self._print("  reset, refused")
        try:
            self._robot.reset()
        except t2.T2Error as refusal:  # the bumper is pressed
            self._print(f"    refused: {refusal}")

        self._print("  release")
        self._repeat(lambda: self._robot.release("backward", OPERATOR))

        self._print("  reset")
        self._reset()

        self._print("  back off")
        self._forward(-0.6, self._careful)

        self._print("  turn home")
        here = self._pose()
        self._turn(wrapped(math.atan2(-here.y, -here.x) - here.heading))

        self._print("  drive home")
        self._forward(math.hypot(here.x, here.y), self._cruise)

        self._print("  turn as at the start")
        self._turn(-self._pose().heading)

    def _forward(self, distance: float, speed: float, expected: str = "") -> None:
        """Drive straight, m and m/s; an ``expected`` cause raises ``Blocked`` or ``Latched``."""
        start = self._pose()

        def go(drive: t2.Drive) -> None:
            driven = travelled(start, self._robot.odometry.latest())
            drive.forward(distance - driven, speed, PATIENCE_S)

        self._motion(go, expected)

    def _turn(self, angle: float) -> None:
        """Turn on the spot, rad."""
        goal = self._pose().heading + angle

        def go(drive: t2.Drive) -> None:
            for _ in range(TURNS_MAX):
                left = wrapped(goal - self._robot.odometry.latest().heading)
                if abs(left) < FACING:
                    return
                drive.turn(left, self._spin, PATIENCE_S)

        self._motion(go)

    def _pose(self) -> Odometry:
        return self._repeat(self._robot.odometry.latest)

    def _reset(self) -> None:
        """Reset until nothing is latched."""

        def clear() -> None:
            while self._robot.safety.latest().latched:
                self._print(f"    granted: {self._robot.reset().text}")

        self._repeat(clear)

    def _motion(self, go: Callable[[t2.Drive], None], expected: str = "") -> None:
        def once() -> None:
            with self._robot.drive(SOURCE) as drive:
                go(drive)

        self._repeat(once, expected)

    def _repeat(self, act: Callable[[], T], expected: str = "") -> T:
        """Repeat an action until it succeeds, or an expected cause stops it."""
        while True:
            self._check()
            try:
                return act()
            except t2.Stopped as stop:
                names = [cause.name for cause in stop.causes]
                if expected in names and isinstance(stop, t2.Blocked | t2.Latched):
                    raise
                if isinstance(stop, t2.Latched):
                    self._reset()
            except t2.Refused as refusal:
                self._print(f"    refused: {refusal}")
            except t2.T2Error:  # no data, for example: wait for it
                pass
            time.sleep(RETRY_S)

    def _print(self, line: str) -> None:
        """Print a step, or safety's answer to it, once."""
        if line != self._shown:
            self._shown = line
            self._show(line)


def travelled(start: Odometry, now: Odometry) -> float:
    """Return the distance along the heading of the start, m."""
    along_x, along_y = math.cos(start.heading), math.sin(start.heading)
    return (now.x - start.x) * along_x + (now.y - start.y) * along_y


def wrapped(angle: float) -> float:
    """Return an angle within -pi..pi."""
    return math.remainder(angle, math.tau)
