"""A simulated vehicle without sockets and clock, and a PC controlled by the test."""

import math
from typing import Any

import msgspec

from common.freshness import NS_PER_S
from common.wire import framing
from common.wire.commands import MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.framing import Received
from common.wire.reports import FROM_BOARD
from sim.faults import Datagram
from sim.model import Model
from sim.requests import Asked
from sim.simulation import Reply, Simulation
from sim.trace import Line, Truth
from sim.world import Plan

PORTS = (4002, 4001)
START_NS = 5 * NS_PER_S  # any time but zero
EMPTY = Plan(title="nothing")


def model(**tables: Any) -> Model:
    """Return a model without noise of the sonars, with these parameters."""
    return msgspec.convert({"sonar": {"noise": 0.0}, **tables}, Model)


def room(*boxes: dict[str, Any], **plan: Any) -> Plan:
    """Return a plan with these boxes."""
    return msgspec.convert({"title": "a room", "boxes": boxes, **plan}, Plan)


WALL_AHEAD = room(walls=[{"points": [[3.0, -5.0], [3.0, 5.0]]}])


class SimFixture:
    """A simulation, the PC's side of the wire, and all that came of it."""

    def __init__(self, plan: Plan = EMPTY, vehicle: Model | None = None) -> None:
        self.simulation = Simulation(vehicle or model(), plan, START_NS, 1, PORTS)
        self.now_ns = START_NS
        self.datagrams: list[Datagram] = []
        self.records: list[Line] = []

    def say(self, *frames: Frame, port: int = 4002) -> list[Frame]:
        """Send frames in one datagram and return what is answered at once."""
        self.simulation.receive(b"".join(map(framing.pack, frames)), port, self.now_ns)
        return self._collect()

    def run(self, linear: float = 0.0, angular: float = 0.0) -> None:
        """Command RUN, in m/s and rad/s."""
        raw = round(math.degrees(angular) * 10)
        self.say(MotionCommand(MotionKind.RUN, round(linear * 1000), raw))

    def stop(self) -> None:
        """Command STOP."""
        self.say(MotionCommand(MotionKind.STOP))

    def after(self, seconds: float) -> list[Frame]:
        """Advance the time in ticks of 10 ms; return the frames sent by the board."""
        end_ns = self.now_ns + round(seconds * NS_PER_S)
        said = []
        while self.now_ns < end_ns:
            self.now_ns = min(end_ns, self.now_ns + NS_PER_S // 100)
            self.simulation.advance(self.now_ns)
            said += self._collect()
        return said

    def do(self, request: Asked) -> Reply:
        """Apply a request."""
        reply = self.simulation.handle(request, self.now_ns)
        self.records += self.simulation.take_records()
        return reply

    @property
    def truth(self) -> Truth:
        """Return the true state."""
        return self.simulation.truth(self.now_ns)

    def frames(self, datagram: Datagram) -> list[Frame]:
        """Return the frames of a datagram that can be read."""
        parts = framing.read(datagram.payload, FROM_BOARD)
        return [part.frame for part in parts if isinstance(part, Received)]

    def of(self, kind: type[Line]) -> list[Any]:
        """Return the trace's lines of one kind."""
        return [record for record in self.records if isinstance(record, kind)]

    def _collect(self) -> list[Frame]:
        sent = self.simulation.take_sent(self.now_ns)
        self.datagrams += sent
        self.records += self.simulation.take_records()
        return [frame for datagram in sent for frame in self.frames(datagram)]
