"""The simulated vehicle in the chain of bridge and safety, with the oracle's complaints."""

from collections import deque
from collections.abc import Callable

from common.freshness import NS_PER_S
from common.wire.commands import TO_BOARD, MotionCommand
from common.wire.framing import Framing, Received
from sim.config import Config
from sim.injection import Injection
from sim.requests import Asked, Script
from sim.simulation import Simulation
from sim.trace import Truth
from sim.world import Plan
from verification.invariants.net import MS, Net
from verification.invariants.vehicle import Complaints, OnMotion

MEMORY_NS = NS_PER_S  # for how long a complaint belongs to later equal frames


class Observed(Simulation):
    """The simulation; reports each motion command that its board takes."""

    on_command: Callable[[MotionCommand], None] | None = None

    def _hold(self, command: MotionCommand, now_ns: int) -> None:
        super()._hold(command, now_ns)
        if self.on_command is not None:
            self.on_command(command)


class SimulatedVehicle:
    """Receives datagrams with their complaints, and sends the simulator's reports."""

    def __init__(self, net: Net, on_motion: OnMotion, config: Config, plan: Plan) -> None:
        self.simulation = Observed(config, plan, net.now_ns)
        self.simulation.on_command = self._on_command
        self.inboxes: tuple[deque[bytes], ...] = (deque(), deque())
        self._injection = Injection(self.simulation, Script(), net.now_ns)
        self._ports = config.board.listen_ports
        self._framing = Framing(config.wire.crc, config.wire.crc_covers)
        self._net = net
        self._on_motion = on_motion
        self._silent_until_ns = 0
        self._complaints: deque[tuple[int, MotionCommand, Complaints]] = deque()
        self.truth = self.simulation.truth(net.now_ns)  # the newest, 20 times a second

    @property
    def silent(self) -> bool:
        """Whether the board is frozen."""
        return self._net.now_ns < self._silent_until_ns

    def inject(self, request: Asked) -> None:
        """Inject a fault of the simulator."""
        self._injection.handle(request, self._net.now_ns)

    def freeze(self, duration_ms: int) -> None:
        """Freeze the board for a while; it keeps its command."""
        self._silent_until_ns = self._net.now_ns + duration_ms * MS
        self.simulation.freeze(duration_ms / 1000, self._net.now_ns)

    def power_cycle(self, duration_ms: int) -> None:
        """Restart the board."""
        self._silent_until_ns = self._net.now_ns + duration_ms * MS
        self.simulation.power_cycle(duration_ms / 1000, self._net.now_ns)

    def receive(self, datagram: bytes, port: int, complaints: Complaints) -> None:
        """Send a datagram to the board."""
        now_ns = self._net.now_ns
        while self._complaints and self._complaints[0][0] < now_ns - MEMORY_NS:
            self._complaints.popleft()
        if complaints:
            for part in self._framing.read(datagram, TO_BOARD):
                if isinstance(part, Received) and isinstance(part.frame, MotionCommand):
                    self._complaints.append((now_ns, part.frame, complaints))
        self.simulation.receive(datagram, self._ports[port], now_ns)

    def turn(self) -> None:
        """Advance to the current time."""
        now_ns = self._net.now_ns
        self.simulation.advance(now_ns)
        for datagram in self.simulation.take_sent(now_ns):
            if not datagram.foreign:
                self.inboxes[self._ports.index(datagram.port)].append(datagram.payload)
        for record in self.simulation.take_records():
            if isinstance(record, Truth):
                self.truth = record

    def _on_command(self, command: MotionCommand) -> None:
        # Datagrams may be late, lost or doubled: a frame carries the complaints of all equal ones.
        complaints = [
            one for _, frame, all_ in self._complaints for one in all_ if frame == command
        ]
        self._on_motion(command, tuple(dict.fromkeys(complaints)))
