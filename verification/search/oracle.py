"""Oracle: checks every frame that leaves a bridge against the messages delivered before.

A RUN that moves is traced back to its motion message, the verdict behind it, and the request and
samples behind the verdict. Each error on that path is a *complaint*, and a violation when the RUN
leaves. A *trip* is an event that latches. Its *holders* are the processes that know of it. The trip
is dropped with its last holder: the safety case accepts that for two processes that die at once.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache

from common.freshness import NS_PER_S
from common.wire import framing
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.framing import Received
from common.wire.reports import FROM_BOARD, BumperReport
from sim import requests as q
from sim import trace as t
from t2 import messages as m
from verification.search.bridge_book import BridgeBook, PressBook
from verification.search.bus import MS, Envelope, Process
from verification.search.condition_books import BRAKING_RADPS2, StandstillBook
from verification.search.safety_book import FAST_S, SafetyBook

# The bridge's lease and tick; the guard needs less.
BUDGET_NS = 230 * MS
STEP_NS = 5 * MS
STALL_NS = 1030 * MS  # of safety: an emergency stop may be lost


@dataclass(eq=False, slots=True)
class Trip:
    """An event that latches, and the processes that know of it."""

    name: str
    holders: set[int]
    bridge: tuple[int, int] | None = None  # boot, and the bumper's ``seq`` that will report it
    message: m.Message | None = None  # that tripped it, at each process that receives it


@dataclass(frozen=True, slots=True)
class Record:
    """Complaints about one motion message, and the trips known to its sender."""

    complaints: tuple[str, ...]
    known: frozenset[Trip]
    creeps: bool  # whether it is a release


@lru_cache
def reported(datagram: bytes) -> list[Frame]:
    """Return the valid frames of a datagram of the board; most of them come again and again."""
    parts = framing.read(datagram, FROM_BOARD)
    return [part.frame for part in parts if isinstance(part, Received)]


@dataclass(repr=False)
class Oracle:
    """The books on all processes, and the violations found."""

    now_ns: int
    safety_books: dict[int, SafetyBook] = field(default_factory=dict)
    bridge_books: dict[int, BridgeBook] = field(default_factory=dict)
    trips: list[Trip] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)
    runs: int = 0  # frames that moved the vehicle
    comeback_ns: int = 0  # last restart of a process or the board
    slack_ns: int = 0  # addition to the budget for disturbances and stalls
    recess: float = 0.0  # m that each sonar is deep in the hull
    turn_braking: float = BRAKING_RADPS2  # rad/s^2, of the settings
    estop_session_up: bool = True
    press: PressBook = field(default_factory=PressBook)
    _records: dict[tuple[int, int], Record] = field(default_factory=dict)
    _links: dict[tuple[int, int], frozenset[Trip]] = field(default_factory=dict)
    _moved_ns: int | None = None  # when the board last took a RUN that moves
    _deaf_until_ns: int = 0  # the board receives nothing

    # --- deliveries -------------------------------------------------------------------------

    def on_put(self, process: Process, envelope: Envelope) -> None:
        """Record a message that a process publishes."""
        message = envelope.message
        book, bridge_book = self.safety_books.get(process.boot), self.bridge_books.get(process.boot)
        if book is not None and isinstance(message, m.SafetyState):
            book.operators.on_state(message, self.now_ns)
        if book is not None and isinstance(message, m.Motion):
            self._on_verdict(book, message)
        if bridge_book is not None and isinstance(message, m.Bumper):
            bridge_book.published += 1
        if bridge_book is not None and isinstance(message, m.Link):
            key = process.boot, message.seq
            self._links[key] = frozenset(self._held_by(process.boot))

    def on_delivery(self, process: Process, envelope: Envelope) -> None:
        """Record a message before its receiver handles it."""
        book, bridge_book = self.safety_books.get(process.boot), self.bridge_books.get(process.boot)
        if envelope.key.endswith("/estop"):
            self._on_estop(process.boot, envelope.message)
        if bridge_book is not None and isinstance(envelope.message, m.Motion):
            record = self._records.get((envelope.message.boot, envelope.message.seq))
            if bridge_book.on_motion(envelope.message, self.now_ns) and record is not None:
                self._inform(record.known, bridge_book.boot)
        if book is not None:
            self._on_delivered(book, envelope)

    def _on_delivered(self, book: SafetyBook, envelope: Envelope) -> None:
        message, name = envelope.message, envelope.key.rsplit("/", 1)[-1]
        if isinstance(message, m.SourceMessage):
            if book.on_source(name, message, self.now_ns):
                self.trip("estop_keepalive", book.boot)
        elif name != "estop":
            book.on_sample(name, message, self.now_ns)
        if isinstance(message, m.Bumper) and message.pressed:
            self._on_pressed(book, message)
        if isinstance(message, m.Driver) and message.bits:
            self.trip("driver", book.boot)
        if isinstance(message, m.Link):
            self._on_link(book, message)

    def _on_link(self, book: SafetyBook, message: m.Link) -> None:
        if message.latched_by not in (None, book.boot):
            book.operators.on_trip("predecessor", self.now_ns)
        if message.estop is not None:
            book.operators.on_trip("estop", self.now_ns)
        self._inform(self._links.get((message.boot, message.seq), ()), book.boot)

    def _on_estop(self, boot: int, message: m.Message) -> None:
        """Record an emergency stop that a process receives: one trip, at all of them."""
        if boot in self.bridge_books:
            self.bridge_books[boot].brake_due = not self.bridge_books[boot].braked
        known = [trip for trip in self.trips if trip.message is message]
        self._inform(known, boot)
        if not known:
            self.trip("estop", boot)
            self.trips[-1].message = message
        elif boot in self.safety_books:
            self.safety_books[boot].operators.on_trip("estop", self.now_ns)

    def _on_pressed(self, book: SafetyBook, message: m.Bumper) -> None:
        for trip in self.trips:
            if trip.bridge is not None and trip.bridge[0] == message.boot:
                self._inform([trip] if message.seq >= trip.bridge[1] else [], book.boot)
        if not any(trip.name == "contact" for trip in self._held_by(book.boot)):
            self.trip("contact", book.boot)

    def on_report(self, process: Process, datagram: bytes, port: int) -> None:
        """Record a datagram of the board, on this port, before the bridge handles it."""
        bridge_book = self.bridge_books[process.boot]
        for frame in reported(datagram):
            if frame == BumperReport(True):
                self.press.noticed = True
            if bridge_book.on_report(frame, port, self.now_ns):
                self.trip("contact", process.boot, (process.boot, bridge_book.published + 1))

    def on_router(self, up: bool) -> None:
        """Record that the router is gone or back."""
        self.estop_session_up = up
        for book in self.safety_books.values():
            if book.estop_session_was_up and not up:
                self.trip("estop_reader", book.boot)

    def on_answer(self, process: Process, request: m.ResetRequest, done: bool) -> None:
        """Record the answer to a reset: a granted one clears trips."""
        book = self.safety_books.get(process.boot)
        if book and done and self.estop_session_up and book.may_reset(self.now_ns):
            self._clear(book, request)

    def _clear(self, book: SafetyBook, request: m.ResetRequest) -> None:
        """Clear trips; those that the request must not clear stay."""
        cleared = [
            trip
            for trip in self._held_by(book.boot)
            if book.is_gone(trip.name) and book.operators.may_clear(request, trip.name, self.now_ns)
        ]
        self.trips = [trip for trip in self.trips if trip not in cleared]
        if any(trip.name == "contact" for trip in cleared):
            book.operators.on_cleared()

    def on_start(self, process: Process) -> None:
        """Open the book of a started process; odometry moves nothing."""
        if process.name != "odom":
            self.comeback_ns = self.now_ns
        if process.name == "safety":
            self.safety_books[process.boot] = SafetyBook(
                process.boot,
                self.recess,
                self.turn_braking,
                bad_ns=self.now_ns,
                standstill=StandstillBook(turn_braking=self.turn_braking),
            )
        if process.name == "bridge":
            self.bridge_books[process.boot] = BridgeBook(process.boot, self.now_ns)

    def on_end(self, process: Process) -> None:
        """Close the book of a process; trips known only to it are dropped."""
        if process.name == "bridge":
            self.press.on_frame(moves=False)  # the guard brakes
        self.safety_books.pop(process.boot, None)
        self.bridge_books.pop(process.boot, None)
        for trip in self.trips:
            trip.holders.discard(process.boot)
        self.trips = [trip for trip in self.trips if trip.holders]

    def trip(self, name: str, holder: int, bridge: tuple[int, int] | None = None) -> None:
        """Record a trip; ``holder`` knows of it."""
        self.trips.append(Trip(name, {holder}, bridge))
        if holder in self.safety_books and name != "contact":
            self.safety_books[holder].operators.on_trip(name, self.now_ns)

    def _held_by(self, boot: int) -> list[Trip]:
        return [trip for trip in self.trips if boot in trip.holders]

    def _inform(self, trips: Iterable[Trip], boot: int) -> None:
        for trip in trips:
            if trip in self.trips:
                trip.holders.add(boot)

    # --- decisions --------------------------------------------------------------------------

    def _on_verdict(self, book: SafetyBook, motion: m.Motion) -> None:
        if self.now_ns - (book.decided_ns or self.now_ns) > STALL_NS:
            self.trip("estop_reader", book.boot)
        book.decided_ns = self.now_ns
        book.estop_session_was_up = book.estop_session_was_up or self.estop_session_up
        if book.fast_ns is not None and self.now_ns - book.fast_ns > FAST_S * NS_PER_S:
            self.trip("runaway", book.boot)
        if book.keepalive.is_lost(self.now_ns):
            self.trip("estop_keepalive", book.boot)
        known = frozenset(self._held_by(book.boot))
        book.look(self.now_ns, self.estop_session_up, {trip.name for trip in known})
        rolls = book.standstill.complaint(motion, moves(motion), self.now_ns)
        self.violations += [rolls] if rolls else []
        complaints: tuple[str, ...] = ()
        creeps = book.creeps(motion)
        book.operators.on_verdict(motion, creeps, self.now_ns)
        if moves(motion):
            complaints = tuple(self._of_verdict(book, motion, known))
        self._records[motion.boot, motion.seq] = Record(complaints, known, creeps)

    def _of_verdict(self, book: SafetyBook, motion: m.Motion, known: frozenset[Trip]) -> list[str]:
        complaints = [f"safety: {one}" for one in book.complaints(motion, self.now_ns)]
        creeps = book.creeps(motion)
        complaints += [
            f"safety knows of {trip.name}"
            for trip in known
            if not (creeps and trip.name == "contact")
        ]
        neutral_ns = book.neutral.get(motion.source or "", 0)
        if not creeps and neutral_ns <= self.comeback_ns:
            complaints.append("no source was neutral since a restart")
        return complaints

    def on_leaving(self, process: Process, datagram: bytes) -> None:
        """Check a datagram that leaves a bridge."""
        bridge_book = self.bridge_books[process.boot]
        for part in framing.read(datagram, TO_BOARD):
            assert isinstance(part, Received), part
            if not isinstance(frame := part.frame, MotionCommand):
                continue
            brakes = frame.kind is MotionKind.BREAK
            if bridge_book.brake_due and not brakes:
                self.violations.append("a hit or an emergency stop without a BRAKE at once")
            if bridge_book.may_only_brake(self.now_ns) and not brakes:
                self.violations.append("a new bridge replaced the guard's BRAKE")
            bridge_book.brake_due, bridge_book.braked = False, brakes
            drives = frame.kind is MotionKind.RUN and bool(frame.linear_mmps or frame.angular_raw)
            self.press.on_frame(drives)
            if drives:
                complaints = self._of_frame(bridge_book, process.taking, frame)
                self.violations += [f"{frame.linear_mmps} mm/s: {one}" for one in complaints]

    def _of_frame(
        self, bridge_book: BridgeBook, cause: Envelope | None, frame: MotionCommand
    ) -> list[str]:
        if cause is None or not isinstance(cause.message, m.Motion):
            return ["bridge: a RUN without a motion"]
        motion = cause.message
        record = self._records.get((motion.boot, motion.seq))
        if record is None or cause.sender != motion.boot:
            return ["bridge: a RUN that no safety sent"]
        complaints = [*record.complaints, *bridge_book.complaints(self.now_ns)]
        if bridge_book.authority != motion.boot or bridge_book.seq != motion.seq:
            complaints.append("bridge: not from the authority, or out of order")
        if not follows(frame, motion):
            complaints.append(f"bridge: {frame} is not {motion}")
        complaints += [
            f"bridge knows of {trip.name}, safety did not"
            for trip in self._held_by(bridge_book.boot)
            if not (record.creeps and trip in record.known)
        ]
        return complaints

    def _on_board(self, line: t.Line) -> None:
        match line:
            case t.Command():
                moves = line.kind == "run" and bool(line.linear or line.angular)
                self._moved_ns = self.now_ns if moves else None
                self.runs += moves
            case t.Power(on=on):
                self._moved_ns = None  # it has lost its command
                self.comeback_ns = self.now_ns if on else self.comeback_ns
            case t.Disturbed(request=q.Freeze(seconds=s) | q.PowerCycle(seconds=s)):
                self._deaf_until_ns = self.now_ns + round(s * NS_PER_S)

    def on_contact(self, closed: bool) -> None:
        """Check that no press of the bumper is missed."""
        if self.press.look(closed, self.now_ns):
            self.violations.append("a press of 60 ms was missed")

    def on_step(self, trace: Iterable[t.Line]) -> None:
        """Check the command that the board holds (invariant 2) after these lines of its trace."""
        for line in trace:
            self._on_board(line)
        budget_ns = BUDGET_NS + self.slack_ns
        if self._moved_ns is not None and self.now_ns < self._deaf_until_ns:
            self._moved_ns = self.now_ns
        if self._moved_ns is not None and self.now_ns - self._moved_ns > budget_ns:
            self.violations.append(f"a RUN is held for more than {budget_ns / MS:.0f} ms")
        for bridge_book in self.bridge_books.values():
            if bridge_book.brake_due:
                self.violations.append("a hit or an emergency stop without a BRAKE at once")


def moves(motion: m.Motion) -> bool:
    """Return whether a motion message moves the vehicle."""
    return motion.command == "run" and not (motion.linear == 0 == motion.angular)


def follows(frame: MotionCommand, motion: m.Motion) -> bool:
    """Return whether a frame matches the motion message, within the wire's resolution."""
    linear = abs(frame.linear_mmps / 1000 - motion.linear) < 0.001
    return linear and abs(frame.angular_raw * 0.1 - motion.angular * 57.29578) < 0.1
