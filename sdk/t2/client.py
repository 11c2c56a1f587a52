"""Client of safety: how a program drives, stops and resets, and how it knows that it may not. Pure.

**Drive requests.** On every tick, 20 times a second, at most one request is sent:

========== =================== =========================================
phase      tick with a request tick without a request
========== =================== =========================================
SILENT     zero; DRIVING       nothing
DRIVING    the request         zero; ENDING, two zeros remain
ENDING     zero; DRIVING       zero; SILENT after the last one
========== =================== =========================================

A request is a twist, or a release off a pressed bumper. The zero before it is the neutral request
that arms safety and the bridge; it is sent again when a release begins, ends or changes its
direction. ``stop`` leads to ENDING with three zeros from any phase. Each message echoes the
newest heartbeat of safety, which bounds its age without synchronized clocks.

**Denied.** A router whose access rules forbid a message drops it without an error, and announces
no subscriber of safety either. A client is denied after ``DENIED_AFTER`` states of safety without.

**Overruled.** A client is overruled after ``OVERRULED_TICKS`` of requests while another source
drives.

**Emergency stop.** It is repeated on every tick until safety reports ``estop`` as latched. A latch
that may be an earlier one has to last for ``KEPT_TICKS``: its reset may be under way. After
``ESTOP_TICKS`` the stop counts as not confirmed; clients on a link that may be down repeat it for
``ESTOP_WAIT_S``.

**Reset.** Any program on the bus may answer the call. Only safety's own state shows the effect:

======== ================================ =====================================
phase    event                            outcome
======== ================================ =====================================
sent     refusal, or no answer            refused, with the reason
sent     answer                           wait for a state, at most ``CONFIRM_S``
answered a state that confirms            confirmed
answered ``CONFIRM_S`` without such state not confirmed
======== ================================ =====================================
"""

from enum import Enum

from msgspec import Struct

from t2.messages import Drive, ReleaseRequest, ResetDone, ResetRequest, SafetyState

CONFIRM_S = 1.0  # from a reset's answer to the state that shows its effect
ZEROS = 3  # requests after a drive: one may be lost
DENIED_AFTER = 10  # states of safety; a router needs a moment to announce its subscribers
OVERRULED_TICKS = 10  # 0.5 s: the client's own requests may be on their way
ESTOP_TICKS = 60  # 3 s at 20 Hz
ESTOP_WAIT_S = 30.0  # from the press; without a link it is sent on reconnect until then
KEPT_TICKS = 10  # 0.5 s: a reset that was sent before has arrived
PASSING = {"no_request", "blocked"}  # stops that end without a neutral request


def request(linear: float = 0.0, angular: float = 0.0, release: ReleaseRequest = "none") -> Drive:
    """Return a request (m/s, rad/s); its publisher fills in header and echo."""
    return Drive(linear=linear, angular=angular, release=release, echo=0)


NEUTRAL = request()


class Phase(Enum):
    """The state that the last tick left."""

    SILENT = "silent"
    DRIVING = "driving"
    ENDING = "ending"


class DriveRequests(Struct):
    """The sequence of drive requests, one tick at a time."""

    phase: Phase = Phase.SILENT
    zeros: int = 0  # left to send while ENDING
    release: ReleaseRequest = "none"  # requested in the last tick of DRIVING

    def tick(self, requested: Drive | None) -> Drive | None:
        """Return the request to send now, or None; ``requested`` is None without a held control."""
        if requested is not None:
            begins = self.phase is not Phase.DRIVING or requested.release != self.release
            self.phase, self.release = Phase.DRIVING, requested.release
            return NEUTRAL if begins else requested
        if self.phase is Phase.DRIVING:
            self.stop()
        if self.phase is Phase.SILENT:
            return None
        self.zeros -= 1
        if self.zeros == 0:
            self.phase = Phase.SILENT
        return NEUTRAL

    def stop(self) -> None:
        """Send the final zeros in the next ticks, from any phase."""
        self.phase, self.zeros = Phase.ENDING, ZEROS


class Access(Struct):
    """The echo of a client's messages, and whether they reach safety."""

    echo: int = 0  # before the first state of safety, which refuses 0
    unmatched: int = 0  # states of safety in a row without a subscriber for our messages

    @property
    def is_denied(self) -> bool:
        """Whether safety's state arrives but our messages would not: watching only."""
        return self.unmatched >= DENIED_AFTER

    def received(self, state: SafetyState, passed_on: bool | None) -> bool:
        """Note a new state; return whether the client is denied from now on.

        ``passed_on``: whether the router announces a subscriber of safety; None if unknown.
        """
        self.echo = state.heartbeat
        self.unmatched = self.unmatched + 1 if passed_on is False else 0
        return self.unmatched == DENIED_AFTER


class Contest(Struct):
    """Counts the ticks in which a client requests motion and another source drives."""

    source: str  # the client's own
    other: str | None = None  # the source that drives instead
    ticks: int = 0  # in a row, with requests

    @property
    def is_lost(self) -> bool:
        """Whether the other source overrules the client."""
        return self.ticks >= OVERRULED_TICKS

    def tick(self, state: SafetyState | None, *, requests: bool) -> None:
        """Count a tick; ``requests``: whether the client requests motion in it."""
        driving = state.source if state else None
        self.other = None if driving == self.source else driving
        self.ticks = self.ticks + 1 if self.other and requests else 0


class EstopStep(Enum):
    """The action of one tick of an emergency stop."""

    NONE = "none"
    REPEAT = "repeat"
    LAST = "last"  # repeat it for the last time and report that it is not confirmed


class EstopRepetition(Struct):
    """An emergency stop that is repeated until safety has latched it."""

    ticks: int = 0  # left; 0 when no stop is pending
    needed: int = 0  # ticks in a row in which the latch must show
    shown: int = 0  # ticks in a row in which it has shown

    @property
    def is_pending(self) -> bool:
        """Whether the stop is still repeated."""
        return self.ticks > 0

    def start(self, state: SafetyState | None, ticks: int | None = None) -> None:
        """Start, or start again, after the first stop was sent; ``state`` is the newest one."""
        self.ticks = ESTOP_TICKS if ticks is None else ticks
        self.shown = 0
        self.needed = 1 if state is not None and "estop" not in state.latched else KEPT_TICKS

    def tick(self, state: SafetyState | None) -> EstopStep:
        """Return the action of this tick; ``state`` is None without a fresh state of safety."""
        if not self.ticks:
            return EstopStep.NONE
        if state is not None and "estop" in state.latched:
            self.shown += 1
        else:
            self.shown, self.needed = 0, KEPT_TICKS if state is None else 1
        is_confirmed = self.shown >= self.needed
        self.ticks = 0 if is_confirmed else self.ticks - 1
        if is_confirmed:
            return EstopStep.NONE
        return EstopStep.REPEAT if self.ticks else EstopStep.LAST


class ResetCheck:
    """A reset under way, from its request to the state that confirms it."""

    def __init__(self, seen: SafetyState) -> None:
        self._seen = seen
        self._done: ResetDone | None = None
        self._until_ns: int | None = None

    @property
    def is_answered(self) -> bool:
        """Whether the answer was received, so that only safety's state is missing."""
        return self._done is not None

    def answer(self, done: ResetDone) -> None:
        """Store the answer; ``outcome`` then waits for the state that confirms it."""
        self._done = done

    def outcome(self, state: SafetyState | None, now_ns: int) -> bool | None:
        """Return whether the reset is confirmed; None while this is open."""
        if self._done is None:
            return None
        if state is not None and confirms(self._seen, self._done, state):
            return True
        if self._until_ns is None:
            self._until_ns = now_ns + round(CONFIRM_S * 1e9)
        return False if now_ns > self._until_ns else None


def reset_request(seen: SafetyState) -> ResetRequest:
    """Return the request to clear exactly the latched causes of this state."""
    latched = tuple(cause.id for cause in seen.causes if cause.name in seen.latched)
    return ResetRequest(echo=seen.heartbeat, causes=latched)


def confirms(seen: SafetyState, done: ResetDone, state: SafetyState) -> bool:
    """Return whether ``state`` shows the effect of the reset that ``done`` claims.

    ``seen`` is the state that the request was built from. The answer must come from the safety
    service that publishes the state. It must name causes that were latched in ``seen``, and none of
    these may remain.
    """
    if not done.boot == seen.boot == state.boot or state.heartbeat < done.heartbeat:
        return False
    cleared, named = set(done.cleared), set(reset_request(seen).causes)
    return bool(cleared) and cleared <= named and not {one.id for one in state.causes} & cleared


def is_stopped(state: SafetyState) -> bool:
    """Return whether a cause stops the vehicle that wants a neutral request in the end."""
    return any(each.action != "slow" and each.name not in PASSING for each in state.causes)


def is_blocked(state: SafetyState) -> bool:
    """Return whether the sonars see an obstacle in the way."""
    return any(each.name == "blocked" for each in state.causes)
