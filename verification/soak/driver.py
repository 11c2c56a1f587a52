"""``python -m verification.soak.driver``: drive laps and recover from faults.

The driver resets latches, waits while odometry is silent, sets the vehicle's true pose after a
restart of odometry (as a localization does), and puts the vehicle back to its start when a lap is
stuck. It is a separate process, so that it can be killed.
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

TRY_S = 0.5  # between two attempts to recover
STEP_S = 75.0  # timeout; the longest step of a lap takes a third of that


class LocatedDriver(Driver):
    """A driver that sets the true pose after each restart of odometry."""

    def __init__(self, robot: t2.Robot, timeout: "StepTimeout", control: Control) -> None:
        super().__init__(robot, LapRecord(timeout.restart), timeout)
        self._control = control
        self._boot: int | None = None  # of the odometry whose pose is set

    def located(self) -> Odometry:
        """Return the pose; after a restart of odometry set it first, at standstill."""
        pose = super().located()
        if pose.boot != self._boot:
            self._set_pose()
            self._boot = pose.boot
            raise t2.NoData("the pose was set: the next one shows it")
        return pose

    def _set_pose(self) -> None:
        try:
            truth = self._control.truth()
        except (LinkError, MessageError) as error:
            raise t2.NoData(str(error)) from None
        if truth.linear or truth.angular:
            raise t2.NoData("the vehicle still moves")
        self.robot.set_pose(truth.x, truth.y, truth.heading)


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
    driver = LocatedDriver(robot, StepTimeout(), control)
    try:
        control.do(Place(x=0.0, y=0.0))
        drive_lap(driver, PATIENT)
    except (LapEndedError, LinkError, MessageError) as error:
        why = [str(error), *(text for *_, text in driver.record.answers[-1:])]
        stuck = "".join(driver.record.steps[-1:])
        log.Logger().warning("lap restarted", stuck=stuck, why=" ".join(why))
        time.sleep(TRY_S)
    else:
        log.Logger().info("lap finished", latches=driver.record.unplanned)


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
