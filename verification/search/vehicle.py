"""The simulated vehicle on the cable, with sensors that may be overridden.

Datagrams to it carry the oracle's complaints; they count when its board takes the motion command.
"""

from collections import deque
from collections.abc import Callable
from functools import partial

from common.freshness import NS_PER_S
from common.motion import Twist
from common.settings import Wire
from common.wire.commands import TO_BOARD, MotionCommand
from common.wire.frame import Side
from common.wire.framing import Framing, Received
from common.wire.reports import VelocityReport
from sim.board import Board
from sim.config import Cable, Config, Sim
from sim.faults import Datagram
from sim.injection import Injection
from sim.requests import Asked, Script
from sim.simulation import Simulation
from sim.sonar import Ranges
from sim.trace import Line, Truth
from sim.world import Plan
from verification.search.bus import MS, Net

MEMORY_NS = NS_PER_S  # for how long a cable with faults may delay a frame
NO_ECHO_MM, FAULT_MM, NEAREST_MM = 5000, 0xFFFF, 60
SENSED, SHADES = 5, 5  # steps of 10 ms per sonar reading, readings until one repeats
Complaints = tuple[str, ...]
OnMotion = Callable[[MotionCommand, Complaints], None]  # the board takes a command


class OverriddenBoard(Board):
    """The board; ``measured`` and ``ranges`` replace what its sensors measure."""

    def __init__(self, wire: Wire, settings: Sim, ranges: Ranges) -> None:
        super().__init__(wire, settings, ranges)
        self.measured: Twist | None = None
        self.ranges: list[int | None] = [None] * len(ranges)  # mm
        self._steps = 0

    def sense(self, twist: Twist, ranges: Ranges, pressed: bool) -> None:
        self._steps += 1
        pairs = zip(self.ranges, ranges, strict=True)
        super().sense(twist, tuple(self._shown(*pair) for pair in pairs), pressed)

    def velocity(self) -> VelocityReport:
        if self.measured is None:
            return super().velocity()
        return VelocityReport(
            round(self.measured.linear * 1000), round(self.measured.angular * 573)
        )

    def _shown(self, mm: int | None, real: int) -> int:
        if mm is None:
            return real
        # A wall that stays the same to the millimetre would be a stuck sensor.
        noise = self._steps // SENSED % SHADES
        return mm + noise if NEAREST_MM < mm < NO_ECHO_MM else mm


class Observed(Simulation):
    """The simulation; reports each motion command that its board takes."""

    on_command: Callable[[MotionCommand], None] = lambda *_: None
    board: OverriddenBoard

    def __init__(self, config: Config, plan: Plan, now_ns: int) -> None:
        super().__init__(config, plan, now_ns)
        self.board = OverriddenBoard(config.wire, config.sim, self._ranges)

    def _hold(self, command: MotionCommand, now_ns: int) -> None:
        super()._hold(command, now_ns)
        self.on_command(command)


class Vehicle:
    """Receives datagrams with their complaints, and sends the board's reports."""

    def __init__(self, net: Net, on_motion: OnMotion, config: Config, plan: Plan) -> None:
        self.simulation = Observed(config, plan, net.now_ns)
        self.simulation.on_command = self._on_command
        self.board = self.simulation.board
        self.inboxes: tuple[deque[bytes], ...] = (deque(), deque())  # the bridge's, by port
        self.truth = self.simulation.truth(net.now_ns)  # the newest, 20 times a second
        self.records: list[Line] = []
        self._injection = Injection(self.simulation, Script(), net.now_ns)
        self._ports = config.board.listen_ports
        self._framing = Framing(config.wire.crc, config.wire.crc_covers)
        self._net = net
        self._on_motion = on_motion
        self._silent_until_ns = 0
        self._complaints: deque[tuple[int, MotionCommand, Complaints]] = deque()
        self._memory_ns = 0 if config.sim.cable == Cable() else MEMORY_NS

    @property
    def silent(self) -> bool:
        """Whether the board is frozen or has no power."""
        return self._net.now_ns < self._silent_until_ns

    @property
    def pressed(self) -> bool:
        """Whether the bumper is pressed by hand."""
        return self.simulation.pressed_by_hand

    @pressed.setter
    def pressed(self, pressed: bool) -> None:
        self.simulation.pressed_by_hand = pressed

    def inject(self, request: Asked) -> None:
        """Inject a fault of the simulator."""
        self._injection.handle(request, self._net.now_ns)

    def freeze(self, duration_ms: int) -> None:
        """Freeze the board for a while; it keeps its command."""
        self._silent_until_ns = self._net.now_ns + duration_ms * MS
        self.simulation.freeze(duration_ms / 1000, self._net.now_ns)

    def power_cycle(self, duration_ms: int) -> None:
        """Restart the board: it loses its command, counters and brake switches."""
        self._silent_until_ns = self._net.now_ns + duration_ms * MS
        self.simulation.power_cycle(duration_ms / 1000, self._net.now_ns)

    def fault(self, side: Side, bits: int) -> None:
        """Set a driver's fault bits; the board reports a fault unasked."""
        self.simulation.set_driver(side, bits, self._net.now_ns)

    def send(self, datagram: bytes) -> None:
        """Send any bytes to both ports of the bridge."""
        for port in self._ports:
            self.simulation.to_pc.put(Datagram(datagram, port), self._net.now_ns)

    def receive(self, datagram: bytes, port: int, complaints: Complaints) -> None:
        """Send a datagram to the board."""
        moves = [
            part.frame
            for part in self._framing.read(datagram, TO_BOARD)
            if isinstance(part, Received) and isinstance(part.frame, MotionCommand)
        ]
        noted = [(frame, complaints) for frame in moves if complaints]
        kind = "motion" if moves else "query"  # or all that is lost might be of one kind
        self._net.later("to_board", partial(self._arrive, datagram, port, noted), kind=kind)

    def turn(self) -> None:
        """Advance to the current time."""
        now_ns = self._net.now_ns
        self.simulation.advance(now_ns)
        for datagram in self.simulation.take_sent(now_ns):
            if not datagram.foreign:
                port = self._ports.index(datagram.port)
                append = partial(self.inboxes[port].append, datagram.payload)
                self._net.later("from_board", append, kind=str(port))
        for record in self.simulation.take_records():
            self.records.append(record)
            if isinstance(record, Truth):
                self.truth = record

    def _arrive(
        self, datagram: bytes, port: int, noted: list[tuple[MotionCommand, Complaints]]
    ) -> None:
        now_ns = self._net.now_ns
        while self._complaints and self._complaints[0][0] < now_ns - self._memory_ns:
            self._complaints.popleft()
        self._complaints += [(now_ns, *one) for one in noted]
        self.simulation.receive(datagram, self._ports[port], now_ns)

    def _on_command(self, command: MotionCommand) -> None:
        # The cable may delay, lose or double: a frame carries the complaints of all equal ones.
        complaints = [
            one for _, frame, all_ in self._complaints for one in all_ if frame == command
        ]
        self._on_motion(command, tuple(dict.fromkeys(complaints)))
