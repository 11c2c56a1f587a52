"""Driver of the lap: the motions of ``t2.Drive``, continued after each stop of safety.

On a host with scheduling stalls safety stops the vehicle now and then. A motion waits and goes on.
A latch that the lap does not expect is reset and counted.
"""

import math
import threading
import time
from collections.abc import Callable
from typing import TypeVar

import t2
from cli.demo.record import LapRecord
from t2.messages import Direction, Odometry

SOURCE = "demo"  # of ``safety.sources``
OPERATOR = "teleop"  # a program may not move off the bumper; here the lap stands in for an operator
PATIENCE_S = 1.0  # without progress, until a motion is requested anew
RETRY_S = 0.1
FACING = 0.03  # rad
TURNS_MAX = 3  # old measurements make a turn end late; the next one corrects it
T = TypeVar("T")


class LapEndedError(Exception):
    """The lap was ended: a timeout, or Ctrl-C."""


class Driver:
    """Moves one robot until ``ended`` is set; then each method raises ``LapEndedError``."""

    def __init__(self, robot: t2.Robot, record: LapRecord, ended: threading.Event) -> None:
        self.record = record
        self.robot = robot
        self._ended = ended

    def pose(self) -> Odometry:
        """Return the pose in ``odom``; wait for it."""
        return self._repeat(self.located)

    def located(self) -> Odometry:
        """Return the pose in ``odom``; raise ``t2.T2Error`` while it is unknown."""
        return self.robot.odometry.latest()

    def wait(self) -> None:
        """Wait until safety lets the vehicle drive."""

        def ready(_: t2.Drive) -> None:
            state = self.robot.safety.latest()
            if state.verdict not in ("run", "slow"):
                raise t2.Blocked(state.text, state.causes)

        self._drive(ready)

    def forward(self, distance: float, speed: float, expected: str = "") -> None:
        """Drive straight, m and m/s; an ``expected`` cause raises ``Blocked`` or ``Latched``."""
        start = self.pose()

        def go(drive: t2.Drive) -> None:
            drive.forward(distance - _travelled(start, self.located()), speed, PATIENCE_S)

        self._drive(go, expected)

    def turn(self, angle: float, speed: float) -> None:
        """Turn on the spot, rad and rad/s."""
        goal = self.pose().heading + angle

        def go(drive: t2.Drive) -> None:
            for _ in range(TURNS_MAX):
                left = math.remainder(goal - self.located().heading, math.tau)
                if abs(left) < FACING:
                    return
                drive.turn(left, speed, PATIENCE_S)

        self._drive(go)

    def release(self, direction: Direction) -> None:
        """Move off the bumper until it is free."""
        self._repeat(lambda: self.robot.release(direction, OPERATOR))

    def reset(self) -> None:
        """Reset until nothing is latched."""

        def clear() -> None:
            while self.robot.safety.latest().latched:
                self.record.answer(True, self.robot.reset().text)

        self._repeat(clear)

    def _drive(self, go: Callable[[t2.Drive], None], expected: str = "") -> None:
        def once() -> None:
            with self.robot.drive(SOURCE) as drive:
                go(drive)

        self._repeat(once, expected)

    def _repeat(self, act: Callable[[], T], expected: str = "") -> T:
        """Repeat an action until it succeeds, or an expected cause stops it."""
        while not self._ended.is_set():
            try:
                return act()
            except t2.Stopped as stop:
                names = [cause.name for cause in stop.causes]
                if expected in names and isinstance(stop, t2.Blocked | t2.Latched):
                    raise
                if isinstance(stop, t2.Latched):
                    self.record.unplanned.append(", ".join(names))
                    self.reset()
            except t2.Refused as refusal:
                self.record.answer(False, str(refusal))
            except t2.T2Error:  # no data, for example: wait for it
                pass
            time.sleep(RETRY_S)
        raise LapEndedError


def connected(robot: str, endpoint: str, ended: threading.Event) -> t2.Robot:
    """Connect, as soon as the router runs; raise ``t2.LinkError`` once ``ended`` is set."""
    while True:
        try:
            return t2.connect(robot, endpoint=endpoint)
        except t2.LinkError:
            if ended.is_set():
                raise


def _travelled(start: Odometry, now: Odometry) -> float:
    """Return the distance along the heading of the start, m."""
    along_x, along_y = math.cos(start.heading), math.sin(start.heading)
    return (now.x - start.x) * along_x + (now.y - start.y) * along_y
