"""The real shells of bridge, safety and odometry around a simulated vehicle and its operator."""

from collections.abc import Iterable
from typing import Any

import msgspec

from common import keys
from common import messages as m
from common.freshness import NS_PER_S
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from sim.config import Config
from verification.invariants.net import MS, Envelope
from verification.invariants.process import ROBOT, Process
from verification.invariants.stack import START_NS, Chain
from verification.vehicles.draw import Draw
from verification.vehicles.judge import PoseError, pose_error
from verification.vehicles.operator import Operator
from verification.vehicles.place import plan
from verification.vehicles.vehicle import SimulatedVehicle

STEP_NS = 10 * MS


class VehicleChain(Chain[SimulatedVehicle]):
    """The chain of one draw."""

    def __init__(self, draw: Draw) -> None:
        config = msgspec.convert(draw.settings(), Config)
        world = plan(draw, config.vehicle)
        super().__init__(
            lambda net, on_motion: SimulatedVehicle(net, on_motion, config, world), STEP_NS
        )
        # Lost and late datagrams may take the STOP that would have been in time.
        cable = config.sim.cable
        for line in (cable.to_board, cable.to_pc):
            self.oracle.slack_ns += round((line.delay + line.jitter) * 1e9)
            self.oracle.slack_ns += 150 * MS if line.drop or line.corrupt else 0
        self.errors: list[PoseError] = []  # of odometry, once a second
        self._origin = self.vehicle.simulation.pose
        self.odometer = self._process("odom", OdomConfig())
        with self.time():
            Odometer(self.odometer)  # type: ignore[arg-type]
        self.operator = Operator(self._process("stick", None), draw)
        self.sticks = {"teleop": self.operator}
        self.hand.subscribe(keys.ODOMETRY, self._on_odometry)

    def processes(self) -> Iterable[Process]:
        """Return the services, in the order of their turns."""
        return *super().processes(), self.odometer

    def press_estop(self) -> None:
        """Put an emergency stop."""
        key = keys.estop_key(ROBOT)
        self.hand.send(Envelope(key, m.Message(), self.hand.boot, self.net.now_ns))

    def act(self) -> None:
        """Ask the operator what to hold, and make the calls."""
        operator = self.operator
        held = operator.held
        operator.act(self.net.now_ns)
        if operator.held is not None:
            self.hold(True, operator.held)
        elif held is not None:
            self.hold(False, held)
        if operator.wants_reset and self.net.now_ns % (500 * MS) == 0:
            self.reset()

    def _on_odometry(self, arrival: Any) -> None:
        if (self.net.now_ns - START_NS) // NS_PER_S > len(self.errors):
            pose = self.vehicle.simulation.pose
            self.errors.append(pose_error(arrival.message, pose, self._origin))
