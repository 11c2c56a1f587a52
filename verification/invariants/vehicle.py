"""Simulated vehicle: the simulator's board, ideal wheels, and sensors set by the test."""

from collections import deque
from collections.abc import Callable, Iterator

from common.motion import Twist
from common.settings import Wire
from common.wire.commands import TO_BOARD, MotionCommand
from common.wire.frame import Frame, Side
from common.wire.framing import Framing, Received
from common.wire.reports import VelocityReport
from sim.board import Board
from sim.config import Drive, Sim
from sim.vehicle import next_twist
from verification.invariants.net import MS, Net

STEP_NS, STREAM_NS = 10 * MS, 20 * MS
NO_ECHO_MM = 5000
Complaints = tuple[str, ...]
OnMotion = Callable[[MotionCommand, Complaints], None]  # the board takes a command


class Vehicle:
    """Receives datagrams with their complaints, and sends reports."""

    def __init__(self, net: Net, on_motion: OnMotion) -> None:
        self.received = 0  # frames
        self.ranges = [NO_ECHO_MM] * 8
        self.board = Board(Wire(), Sim(), self._measure())
        self.twist = Twist()
        self.measured: Twist | None = None  # reported instead of the true twist
        self.pressed = False
        self.silent_until_ns = 0
        self.reports_velocity = True
        self.inboxes: tuple[deque[bytes], ...] = (deque(), deque())  # the bridge's, by port
        self._on_motion = on_motion
        self._net = net
        self._framing = Framing()
        self._due_ns = self._stream_ns = net.now_ns

    @property
    def silent(self) -> bool:
        """Whether the board is frozen."""
        return self._net.now_ns < self.silent_until_ns

    def freeze(self, duration_ms: int) -> None:
        """Freeze the board for a while; it keeps its command."""
        self.silent_until_ns = self._net.now_ns + duration_ms * MS

    def power_cycle(self, duration_ms: int) -> None:
        """Restart the board: it loses its command, counters and brake switches."""
        self.twist = Twist()
        self.board.power_on()
        self.freeze(duration_ms)

    def fault(self, side: Side, bits: int) -> None:
        """Set a driver's fault bits; the board reports a fault unasked."""
        self.board.driver_bits[side] = bits
        if bits:
            self.say(self.board.driver(side))

    def say(self, frame: Frame) -> None:
        """Send a report to the bridge."""
        self.say_bytes(self._framing.pack(frame))

    def say_bytes(self, datagram: bytes) -> None:
        """Send any bytes to the bridge."""
        if not self.silent:
            self._net.later("from_board", lambda: self.inboxes[0].append(datagram))

    def receive(self, datagram: bytes, port: int, complaints: Complaints) -> None:
        """Send a datagram to the board."""
        moves = any(isinstance(frame, MotionCommand) for frame in frames(self._framing, datagram))
        kind = "motion" if moves else "query"  # or all that is lost might be of one kind
        self._net.later("to_board", lambda: self._take(datagram, complaints), kind=kind)

    def turn(self) -> None:
        """Advance to the current time."""
        while self._due_ns <= self._net.now_ns:
            self._due_ns += STEP_NS
            self._move()
        if self._stream_ns <= self._net.now_ns:
            self._stream_ns += STREAM_NS
            if self.reports_velocity:
                self.say(self._velocity())

    def _take(self, datagram: bytes, complaints: Complaints) -> None:
        if self.silent:
            return
        for frame in frames(self._framing, datagram):
            self.received += 1
            answer = self.board.answer(frame)
            if isinstance(frame, MotionCommand):
                self._on_motion(frame, complaints)
            if answer is not None:
                self.say(answer)

    def _move(self) -> None:
        command, dt = self.board.drive(), STEP_NS / 1e9
        self.twist = next_twist(self.twist, command.kind, self.board.target(command), Drive(), dt)
        self.board.count(self.twist.linear * dt, self.twist.angular * dt)
        self.board.sense(self.twist, self._measure(), self.pressed)

    def _velocity(self) -> VelocityReport:
        if self.measured is None:
            return self.board.velocity()
        return VelocityReport(
            round(self.measured.linear * 1000), round(self.measured.angular * 573)
        )

    def _measure(self) -> tuple[int, int, int, int, int, int, int, int]:
        a, b, c, d, e, f, g, h = (
            # A wall that stays the same to the millimetre would be a stuck sensor.
            mm + (self.received % 5 if 60 < mm < NO_ECHO_MM else 0)
            for mm in self.ranges
        )
        return a, b, c, d, e, f, g, h


def frames(framing: Framing, datagram: bytes) -> Iterator[Frame]:
    """Yield the valid frames of a datagram."""
    for part in framing.read(datagram, TO_BOARD):
        if isinstance(part, Received):
            yield part.frame
