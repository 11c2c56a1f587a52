"""``python -m verification.soak.driver``: drive laps and recover from faults.

The driver resets latches, waits while odometry is silent, sets the vehicle's true pose after a
restart of odometry (as a localization does), and puts the vehicle back to its start when a lap is
stuck. It is a separate process, so that it can be killed. It imports nothing of ``verification``:
the systemd test copies this file to another computer.
"""

import argparse
import signal
import sys
from collections.abc import Callable
from contextlib import closing

from msgspec.structs import replace

from cli.demo.driver import PERIOD_S, Driver
from cli.demo.script import PATIENT, QUICK, Lap, Pace, lap, wrap
from cli.settings import Everything
from common import keys, log
from common.bus.bus import Bus
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import LinkError, MessageError
from common.freshness import NS_PER_S
from common.loop import Loop
from common.messages import Done, PoseRequest
from sim.requests import Place
from sim.sockets import Control

OLD_NS = NS_PER_S // 2  # an older pose is not used
TRY_NS = NS_PER_S // 2  # between two attempts to recover
STEP_S = {QUICK: 30.0, PATIENT: 75.0}  # a step takes a third of that; a lap has none longer


class Operator:
    """Drives laps forever; all methods run in the loop's thread."""

    def __init__(self, bus: Bus, control: Control, pace: Pace) -> None:
        self._bus, self._control, self._pace = bus, control, pace
        self._driver = Driver(bus, self._new_lap(), lambda _: None)
        self._log = log.Logger()
        self._patience_ns = round(STEP_S[pace] * NS_PER_S)
        self._recover: Callable[[], PoseRequest | None] | None = self._put_back
        self._tried_ns = 0
        self._step_ns = 0  # start of the step; 0 before it
        self._boot: int | None = None  # boot of the odometry whose pose is set

    def on_beat(self, now_ns: int) -> None:
        """Run one control step; 20 times a second."""
        driver = self._driver
        del driver.odometry[:-1]
        if self._recover is not None:
            self._try(now_ns)
        elif not driver.odometry or now_ns - driver.odometry[-1].mono_ns > OLD_NS:
            return  # without requests the vehicle stops
        elif driver.odometry[-1].boot != self._boot:
            self._recover = self._relocate
        elif driver.lap.step is None:
            self._log.info("lap finished", latches=driver.lap.unplanned)
            self._driver.lap, self._step_ns = self._new_lap(), 0
        elif self._step_ns and now_ns - self._step_ns > self._patience_ns:
            self._log.warning("begun anew", stuck=driver.lap.step.name, why=self._why())
            self._recover = self._put_back
        else:
            self._drive(now_ns)

    def _drive(self, now_ns: int) -> None:
        self._step_ns = self._step_ns or now_ns
        lap, index = self._driver.lap, self._driver.lap.index
        self._driver.on_beat(now_ns)
        if lap.index > index:
            self._step_ns = now_ns
            self._log.info("step", name=lap.steps[index].name)

    def _new_lap(self) -> Lap:
        return Lap(lap(fast=False, pace=self._pace))

    def _why(self) -> str:
        safety = self._driver.safety
        words = [safety.text if safety else "no safety state"]
        return " ".join([*words, *(text for *_, text in self._driver.answers[-1:])])

    # --- recovery -----------------------------------------------------------------------------

    def _try(self, now_ns: int) -> None:
        if now_ns - self._tried_ns < TRY_NS or self._recover is None:
            return
        self._tried_ns = now_ns
        try:
            pose = self._recover()
        except (LinkError, MessageError) as error:
            self._log.warning("cannot recover yet", error=str(error))
            return
        safety = self._driver.safety
        if pose is not None and safety is not None:
            pose = replace(pose, echo=safety.heartbeat)
            self._bus.call(keys.SET_POSE, pose, self._done, self._refused)

    def _put_back(self) -> PoseRequest | None:
        self._control.do(Place(x=0.0, y=0.0))
        self._driver.lap = self._new_lap()
        return PoseRequest()

    def _relocate(self) -> PoseRequest | None:
        truth = self._control.truth()
        if truth.linear or truth.angular:
            return None
        return PoseRequest(x=truth.x, y=truth.y, heading=wrap(truth.heading))

    def _done(self, _: Done) -> None:
        if self._driver.odometry:
            self._boot = self._driver.odometry[-1].boot
            self._recover, self._driver.lap.began, self._step_ns = None, None, 0

    def _refused(self, reason: str) -> None:
        self._log.warning("cannot recover yet", error=reason)


def main() -> int:
    """Drive until SIGTERM."""
    parser = argparse.ArgumentParser(prog="python -m verification.soak.driver")
    parser.add_argument(
        "--patient", action="store_true", help="relaxed pace for a host with stalls"
    )
    add_sources(parser)
    options = parser.parse_args()
    config = load(Everything, sources(options)).config
    log.configure(config.log, "driver")
    with (
        closing(Loop()) as loop,
        closing(Bus(config.bus, config.robot.id, loop.post)) as bus,
    ):
        control = Control(config.sim.control_port, timeout_s=1.0)
        operator = Operator(bus, control, PATIENT if options.patient else QUICK)
        signal.signal(signal.SIGTERM, lambda *_: loop.stop())
        bus.open()
        loop.every(PERIOD_S, operator.on_beat)
        log.Logger().info("started")
        loop.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
