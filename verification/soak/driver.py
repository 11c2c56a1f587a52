"""``python -m verification.soak.driver``: drive laps and recover from faults.

The driver resets latches and waits while odometry is silent. When odometry restarts or a step takes
too long, it begins the lap again. It is a separate process, so that it can be killed.
"""

import argparse
import signal
import sys
import time

import t2
from cli.demo.command import connected
from cli.demo.lap import PATIENT, Lap
from cli.settings import Everything
from common import log
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import LinkError, MessageError
from sim.requests import Place
from sim.sockets import Control

TRY_S = 0.5  # until the next attempt
STEP_S = 75.0  # timeout; the longest step of a lap takes a third of that


class LapEndedError(Exception):
    """The lap must begin again."""


class StepTimeout:
    """Ends the lap when a step takes too long, or odometry restarts: its pose is then another."""

    def __init__(self, robot: t2.Robot) -> None:
        self._robot, self._boot = robot, robot.odometry.latest().boot
        self._end_s = time.monotonic() + STEP_S

    def show(self, step: str, answer: str) -> None:
        """Log the begin of a step."""
        if not answer:
            log.Logger().info("step", name=step)
            self._end_s = time.monotonic() + STEP_S

    def check(self) -> None:
        """Raise ``LapEndedError`` if the lap must begin again."""
        if time.monotonic() > self._end_s:
            raise LapEndedError("the step takes too long")
        newest = self._robot.odometry.newest
        if newest is not None and newest.boot != self._boot:
            raise LapEndedError("odometry has restarted")


def drive(robot: t2.Robot, control: Control) -> None:
    """Drive one lap from the start of the world; give it up when a step takes too long."""
    try:
        control.do(Place(x=0.0, y=0.0))
        robot.set_pose()
        timeout = StepTimeout(robot)
        Lap(robot, PATIENT, show=timeout.show, check=timeout.check).drive()
    except (LapEndedError, t2.T2Error, LinkError, MessageError) as error:
        log.Logger().warning("lap restarted", why=str(error))
        time.sleep(TRY_S)
    else:
        log.Logger().info("lap finished")


def main() -> int:
    """Drive until SIGTERM."""
    parser = argparse.ArgumentParser(prog="python -m verification.soak.driver")
    add_sources(parser)
    config = load(Everything, sources(parser.parse_args())).config
    log.configure(config.log, "driver")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    log.Logger().info("started")
    control = Control(config.sim.control_port, timeout_s=1.0)
    with connected(config, lambda: None) as robot:
        while True:
            drive(robot, control)


if __name__ == "__main__":
    sys.exit(main())
