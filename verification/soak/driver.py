"""``python -m verification.soak.driver``: drive laps and recover from faults.

The driver resets latches and waits while odometry is silent. When odometry restarts or a step takes
too long, it begins the lap again. It is a separate process, so that it can be killed.
"""

import argparse
import signal
import sys
import threading
import time

import t2
from cli.demo.driver import Driver, LapEndedError, connected
from cli.demo.lap import PATIENT, drive_lap
from cli.demo.record import LapRecord
from cli.settings import Everything
from common import log
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import LinkError, MessageError
from sim.requests import Place
from sim.sockets import Control
from t2.messages import Odometry

TRY_S = 0.5  # until the next attempt
STEP_S = 75.0  # timeout; the longest step of a lap takes a third of that


class LapDriver(Driver):
    """A driver that ends the lap when odometry restarts: its pose is then another one."""

    def __init__(self, robot: t2.Robot, timeout: "StepTimeout") -> None:
        super().__init__(robot, LapRecord(timeout.restart), timeout)
        self._boot = robot.odometry.latest().boot

    def located(self) -> Odometry:
        """Return the pose."""
        pose = super().located()
        if pose.boot != self._boot:
            raise LapEndedError("odometry has restarted")
        return pose


class StepTimeout(threading.Event):
    """Set when a step takes too long; without a thread, whose number the soak watches."""

    def __init__(self) -> None:
        super().__init__()
        self._end_s = time.monotonic() + STEP_S

    def restart(self, name: str) -> None:
        """Begin a step."""
        log.Logger().info("step", name=name)
        self._end_s = time.monotonic() + STEP_S

    def is_set(self) -> bool:
        """Return whether the step has taken too long."""
        return time.monotonic() > self._end_s


def drive(robot: t2.Robot, control: Control) -> None:
    """Drive one lap from the start of the world; give it up when a step takes too long."""
    try:
        control.do(Place(x=0.0, y=0.0))
        robot.set_pose()
        drive_lap(LapDriver(robot, StepTimeout()), PATIENT)
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
    with connected(config.robot.id, config.bus.endpoints[0], threading.Event()) as robot:
        while True:
            drive(robot, control)


if __name__ == "__main__":
    sys.exit(main())
