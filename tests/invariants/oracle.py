"""The oracle: judges every frame that the board receives by what everybody had been told.

A RUN that moves is traced back to its motion message, the verdict behind that, and the request and
the samples behind the verdict. What is wrong on the way is a *complaint*; a complaint counts
when the frame that it is about reaches the board. A *trip* is an event that latches. It has
holders, the processes that know of it, and is forgotten with the last of them: two processes that
die at once take it along, which the safety case says.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from common import messages as m
from common.freshness import NS_PER_S
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.framing import Framing, Received
from tests.invariants.bridge_book import Gate
from tests.invariants.net import MS, Letter
from tests.invariants.operator_book import Hold
from tests.invariants.process import Process, Watch
from tests.invariants.safety_book import FAST_S, Desk

# The bridge's lease and tick; the guard needs less.
BUDGET_NS = 230 * MS
STEP_NS = 5 * MS


@dataclass(eq=False, slots=True)
class Trip:
    """Something that latches, and who knows of it."""

    name: str
    holders: set[int]
    bridge: tuple[int, int] | None = None  # boot, and the bumper's ``seq`` that will tell of it


@dataclass(frozen=True, slots=True)
class Record:
    """What is wrong with one motion, and which trips its sender knew."""

    complaints: tuple[str, ...]
    known: frozenset[Trip]


@dataclass(repr=False)
class Judge(Watch):
    """Everybody's books, and what came of them."""

    now_ns: int
    desks: dict[int, Desk] = field(default_factory=dict)
    gates: dict[int, Gate] = field(default_factory=dict)
    trips: list[Trip] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)
    runs: int = 0  # frames that moved the vehicle
    comeback_ns: int = 0  # when a process or the board came back last
    slack_ns: int = 0  # what the weather and hang-ups may add to the budget
    reader_up: bool = True
    _records: dict[tuple[int, int], Record] = field(default_factory=dict)
    _links: dict[tuple[int, int], frozenset[Trip]] = field(default_factory=dict)
    _moved_ns: int | None = None  # when the board last took a RUN that moves
    _framing: Framing = field(default_factory=Framing)

    # --- what is told -----------------------------------------------------------------------

    def on_put(self, process: Process, letter: Letter) -> None:
        """Note what a process says."""
        message = letter.message
        desk, gate = self.desks.get(process.boot), self.gates.get(process.boot)
        if desk is not None and isinstance(message, m.SafetyState):
            desk.operators.on_state(message, self.now_ns)
        if desk is not None and isinstance(message, m.Motion):
            self._on_verdict(desk, message)
        if gate is not None and isinstance(message, m.Bumper):
            gate.published += 1
        if gate is not None and isinstance(message, m.Link):
            key = process.boot, message.seq
            self._links[key] = frozenset(self._held_by(process.boot))

    def on_delivery(self, process: Process, letter: Letter) -> None:
        """Note what a process is told, before it knows."""
        desk, gate = self.desks.get(process.boot), self.gates.get(process.boot)
        if gate is not None and isinstance(letter.message, m.Motion):
            record = self._records.get((letter.message.boot, letter.message.seq))
            if gate.on_motion(letter.message, self.now_ns) and record is not None:
                self._tell(record.known, gate.boot)
        if desk is not None:
            self._on_told(desk, letter)

    def _on_told(self, desk: Desk, letter: Letter) -> None:
        message, name = letter.message, letter.key.rsplit("/", 1)[-1]
        if isinstance(message, m.Drive):
            desk.on_drive(name, message, self.now_ns)
        elif name == "estop":
            self.trip("estop", desk.boot)
        else:
            desk.on_sample(name, message, self.now_ns)
        if isinstance(message, m.Bumper) and message.pressed:
            self._on_pressed(desk, message)
        if isinstance(message, m.Driver) and message.bits:
            self.trip("driver", desk.boot)
        if isinstance(message, m.Link):
            trips = self._links.get((message.boot, message.seq), ())
            if message.latched_by not in (None, desk.boot):
                desk.operators.on_trip("predecessor", self.now_ns)
            self._tell(trips, desk.boot)

    def _on_pressed(self, desk: Desk, message: m.Bumper) -> None:
        for trip in self.trips:
            if trip.bridge is not None and trip.bridge[0] == message.boot:
                self._tell([trip] if message.seq >= trip.bridge[1] else [], desk.boot)
        if not any(trip.name == "contact" for trip in self._held_by(desk.boot)):
            self.trip("contact", desk.boot)

    def on_report(self, process: Process, frames: Iterable[Frame]) -> None:
        """Note what the board tells a bridge, before it knows."""
        gate = self.gates[process.boot]
        for frame in frames:
            if gate.on_report(frame, self.now_ns):
                self.trip("contact", gate.boot, (gate.boot, gate.published + 1))

    def on_reset(self, process: Process, request: m.ResetRequest) -> None:
        """Note that an operator's reset was granted; what it must not clear stays."""
        desk = self.desks.get(process.boot)
        if desk is None or not self.reader_up or not desk.may_reset(self.now_ns):
            return
        cleared = [
            trip
            for trip in self._held_by(desk.boot)
            if desk.is_gone(trip.name) and desk.operators.may_clear(request, trip.name, self.now_ns)
        ]
        self.trips = [trip for trip in self.trips if trip not in cleared]
        if any(trip.name == "contact" for trip in cleared):
            desk.operators.on_cleared()

    def on_hold(self, process: Process, request: m.ReleaseRequest) -> None:
        """Note that an operator holds or ends the release."""
        desk = self.desks.get(process.boot)
        if desk is not None:
            desk.operators.on_hold(request, self.now_ns)

    def holds(self, process: Process) -> Hold | None:
        """Return which release was granted last."""
        desk = self.desks.get(process.boot)
        return desk.operators.hold if desk is not None else None

    def on_refusal(self, process: Process, before: Hold | None) -> None:
        """Note that a call was refused: what was granted before may go on."""
        desk = self.desks.get(process.boot)
        if desk is not None:
            desk.operators.hold = before

    def on_start(self, process: Process) -> None:
        """Open a book for a process that has started."""
        self.comeback_ns = self.now_ns
        if process.name == "safety":
            self.desks[process.boot] = Desk(process.boot, bad_ns=self.now_ns)
        else:
            self.gates[process.boot] = Gate(process.boot)

    def on_end(self, process: Process) -> None:
        """A process has died, and what it alone knew is forgotten."""
        self.desks.pop(process.boot, None)
        self.gates.pop(process.boot, None)
        for trip in self.trips:
            trip.holders.discard(process.boot)
        self.trips = [trip for trip in self.trips if trip.holders]

    def trip(self, name: str, holder: int, bridge: tuple[int, int] | None = None) -> None:
        """Something latches; ``holder`` knows of it."""
        self.trips.append(Trip(name, {holder}, bridge))
        if holder in self.desks and name != "contact":
            self.desks[holder].operators.on_trip(name, self.now_ns)

    def _held_by(self, boot: int) -> list[Trip]:
        return [trip for trip in self.trips if boot in trip.holders]

    def _tell(self, trips: Iterable[Trip], boot: int) -> None:
        for trip in trips:
            if trip in self.trips:
                trip.holders.add(boot)

    # --- what is done -----------------------------------------------------------------------

    def _on_verdict(self, desk: Desk, motion: m.Motion) -> None:
        if desk.reader_was_up and not self.reader_up:
            self.trip("estop_reader", desk.boot)
        desk.reader_was_up = desk.reader_was_up or self.reader_up
        if desk.fast_ns is not None and self.now_ns - desk.fast_ns > FAST_S * NS_PER_S:
            self.trip("runaway", desk.boot)
        known = frozenset(self._held_by(desk.boot))
        desk.look(self.now_ns, self.reader_up, bool(known))
        rolls = desk.rest.complaint(motion, moves(motion), self.now_ns)
        self.violations += [rolls] if rolls else []
        complaints: tuple[str, ...] = ()
        desk.operators.on_verdict(motion, self.now_ns)
        if moves(motion):
            complaints = tuple(self._of_verdict(desk, motion, known))
        self._records[motion.boot, motion.seq] = Record(complaints, known)

    def _of_verdict(self, desk: Desk, motion: m.Motion, known: frozenset[Trip]) -> list[str]:
        complaints = [f"safety: {one}" for one in desk.complaints(motion, self.now_ns)]
        creeps = motion.source == "release"
        complaints += [
            f"safety knows of {trip.name}"
            for trip in known
            if not (creeps and trip.name == "contact")
        ]
        neutral_ns = desk.neutral.get(motion.source or "", 0)
        if not creeps and neutral_ns <= self.comeback_ns:
            complaints.append("nobody was neutral since something came back")
        return complaints

    def on_leaving(self, process: Process, datagram: bytes) -> tuple[str, ...]:
        """Judge a datagram that leaves a bridge; return the complaints that travel with it."""
        gate = self.gates[process.boot]
        for part in self._framing.read(datagram, TO_BOARD):
            assert isinstance(part, Received), part
            if not isinstance(part.frame, MotionCommand):
                continue
            if gate.brake_due and part.frame.kind is not MotionKind.BREAK:
                self.violations.append("a hit without a BREAK at once")
            gate.brake_due = False
            if part.frame.kind is MotionKind.RUN and moving(part.frame):
                return tuple(self._of_frame(gate, process.taking, part.frame))
        return ()

    def _of_frame(self, gate: Gate, cause: Letter | None, frame: MotionCommand) -> list[str]:
        if cause is None or not isinstance(cause.message, m.Motion):
            return ["bridge: a RUN without a motion"]
        motion = cause.message
        record = self._records.get((motion.boot, motion.seq))
        if record is None or cause.sender != motion.boot:
            return ["bridge: a RUN that no safety sent"]
        complaints = [*record.complaints, *gate.complaints(self.now_ns)]
        if gate.authority != motion.boot or gate.seq != motion.seq:
            complaints.append("bridge: from who has not the say, or out of order")
        if not follows(frame, motion):
            complaints.append(f"bridge: {frame} is not {motion}")
        complaints += [
            f"bridge knows of {trip.name}, safety did not"
            for trip in self._held_by(gate.boot)
            if not (motion.source == "release" and trip in record.known)
        ]
        return complaints

    def on_board(self, frame: MotionCommand, complaints: tuple[str, ...]) -> None:
        """The board takes a frame: now the complaints count."""
        moves = frame.kind is MotionKind.RUN and moving(frame)
        self._moved_ns = self.now_ns if moves else None
        self.runs += moves
        self.violations += [f"{frame.linear_mmps} mm/s: {one}" for one in complaints]

    def on_power_cycle(self) -> None:
        """The board has forgotten its command."""
        self._moved_ns = None

    def on_step(self, deaf: bool) -> None:
        """Judge what the board holds while time passes (invariant 2); ``deaf`` hears nothing."""
        budget_ns = BUDGET_NS + self.slack_ns
        if deaf and self._moved_ns is not None:
            self._moved_ns = self.now_ns
        if self._moved_ns is not None and self.now_ns - self._moved_ns > budget_ns:
            self.violations.append(f"a RUN is held for more than {budget_ns / MS:.0f} ms")
        for gate in self.gates.values():
            if gate.brake_due:
                self.violations.append("a hit without a BREAK at once")


def moves(motion: m.Motion) -> bool:
    """Tell whether a motion is to move the vehicle."""
    return motion.command == "run" and not (motion.linear == 0 == motion.angular)


def moving(frame: MotionCommand) -> bool:
    """Tell whether a RUN frame moves the vehicle."""
    return frame.linear_mmps != 0 or frame.angular_raw != 0


def follows(frame: MotionCommand, motion: m.Motion) -> bool:
    """Tell whether a frame says what the motion says, within the wire's resolution."""
    linear = abs(frame.linear_mmps / 1000 - motion.linear) < 0.001
    return linear and abs(frame.angular_raw * 0.1 - motion.angular * 57.29578) < 0.1
