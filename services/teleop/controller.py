"""Controller of teleop: combines keys, gamepad and bus in the node's loop.

The screen runs in another thread. It posts key presses to this loop and reads ``view``. A slow
terminal can therefore delay a key, but never a zero request.
"""

from common import clock, keys
from common.bus.bus import Arrival
from common.freshness import NS_PER_S
from common.messages import Event, SafetyState
from common.operator import Contest, EstopRepetition, EstopStep, Request
from common.service import Node
from common.source import DriveSource
from services.teleop.config import TeleopConfig
from services.teleop.controls import DIRECTIONS, RELEASE, STOP, Controls, Deflection, Stick, twist
from services.teleop.core.hold import Press
from services.teleop.core.round_trip import ADVICE, RoundTrip
from services.teleop.gamepad import Gamepad, NoGamepad
from services.teleop.operator_calls import OperatorCalls
from services.teleop.view import LINES, EventLog, LatestTopic, View

PERIOD_S = 0.05  # 20 Hz, which safety's lease of 0.3 s requires
SCREEN_TIMEOUT_S = 1.0  # without a redraw the terminal is lost: the gamepad is released
MAX_PRESS_AGE_S = 0.5  # an older press is ignored, except a stop
UNHEARD_TICKS = 10  # without a fresh state of safety; with its own 0.5 s this is 1 s
ESTOP, RESET = "e", "r"
BY_TERMINAL = {*DIRECTIONS, *RELEASE, RESET}  # the keys that need a fast terminal
FAST_S, LINK_S, SLOW_S = 0.5, 1.0, 2.0  # how long a stream's last value is shown


class Controller:
    """Key presses in, requests out, and a view of the state; all methods in the loop's thread."""

    def __init__(self, node: Node[TeleopConfig], event_log: EventLog) -> None:
        self._node = node
        self._bus = bus = node.bus
        self._settings = node.config.teleop
        self._event_log = event_log
        self._controls = Controls(self._settings)
        self._gamepad: Gamepad = NoGamepad("searching")
        self._drawn_ns = 0  # the last redraw of the screen
        self._requested: Request | None = None
        self._leaving = False
        self.terminal = RoundTrip(self._settings.round_trip)
        self._slow = False  # the warning about the slow terminal was shown
        self._dropped_ns: int | None = None  # when a late press was last reported
        self._unheard: int | None = None  # ticks; None before the first state of safety
        self._estop = EstopRepetition()
        self._contest = Contest(self._settings.source)
        self._overruled_by: str | None = None  # while that source drives
        self._unconfirmed = False  # whether safety never showed our emergency stop
        self._source = source = DriveSource(bus, self._settings.source, self._report_denied)
        self._calls = OperatorCalls(node, event_log, lambda: source.denied)
        self._safety = LatestTopic(bus, keys.SAFETY, FAST_S)
        self._velocity = LatestTopic(bus, keys.VELOCITY, FAST_S)
        self._odometry = LatestTopic(bus, keys.ODOMETRY, FAST_S)
        self._ultrasonic = LatestTopic(bus, keys.ULTRASONIC, FAST_S)
        self._bumper = LatestTopic(bus, keys.BUMPER, FAST_S)
        self._link = LatestTopic(bus, keys.LINK, LINK_S)
        self._left = LatestTopic(bus, keys.DRIVER, SLOW_S, side="left")
        self._right = LatestTopic(bus, keys.DRIVER, SLOW_S, side="right")
        bus.subscribe(keys.EVENTS, self._on_event, depth=LINES, service="*")
        self.view = self._make_view(clock.now_ns())
        node.loop.every(PERIOD_S, self.tick)

    # --- called by the screen and by __main__ -------------------------------------------------

    def use_gamepad(self, gamepad: Gamepad) -> None:
        """Accept this gamepad besides the keys."""
        self._gamepad = gamepad

    def screen_drawn(self, now_ns: int) -> None:
        """Note that the screen was redrawn, so the operator still sees it."""
        self._drawn_ns = now_ns

    def press(self, press: Press, now_ns: int) -> None:
        """Handle a key press or its repeat.

        ========== ============================== ======================== =============
        key        older than ``MAX_PRESS_AGE_S`` terminal refused         otherwise
        ========== ============================== ======================== =============
        E, space   accepted                       accepted                 accepted
        R          ignored, with a line           ignored, with an event   accepted
        motion     ignored, with a line           muted, with an event     accepted
        others     ignored, with a line           accepted                 accepted
        ========== ============================== ======================== =============
        """
        if self._leaving:
            return
        if press.key == ESTOP:
            self._start_estop(now_ns)
        elif press.key == STOP:
            self._controls.press(STOP, now_ns)
        elif press.age_s(now_ns) > MAX_PRESS_AGE_S:
            self._drop(press, now_ns)
        elif press.key in BY_TERMINAL and (reason := self.terminal.refusal(press.at_ns)):
            self._refuse(reason, now_ns)
        elif press.key == RESET:
            self._calls.reset(press.shown, self._safety.at(now_ns))
        else:
            self._controls.press(press.key, press.at_ns)

    def release_controls(self) -> None:
        """Release keys and gamepad, as when the terminal loses the focus."""
        self._controls.release_all()

    def leave(self) -> None:
        """Send the final zeros, then stop the loop."""
        if not self._leaving:
            self._leaving = True
            self._controls.stop()

    # --- the loop ---------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Send the requests of this tick and renew the view."""
        if self._leaving and self._controls.silent:
            self._node.loop.stop()
            return
        self._check_safety(now_ns)
        self._check_terminal(now_ns)
        self._repeat_estop(now_ns)
        self._drive(now_ns)
        self._yield(now_ns)
        self._calls.check_reset(self._safety.at(now_ns), now_ns)
        self.view = self._make_view(now_ns)

    def _drive(self, now_ns: int) -> None:
        had_expired = self._controls.gamepad_expired
        self._requested = self._controls.tick(self._read_stick(now_ns), now_ns)
        if (request := self._requested) is not None:
            self._source.request(request.twist.linear, request.twist.angular, request.release)
        if self._controls.gamepad_expired and not had_expired:
            text = (
                f"gamepad released: deflected, and no event for {self._settings.gamepad_silence:g} "
                "s; release the deadman, then press it again"
            )
            self._node.event("gamepad_silent", "warning", text)

    def _yield(self, now_ns: int) -> None:
        """End a hold while another source drives: its end must not resume our motion."""
        contest = self._contest
        was_lost = contest.is_lost
        contest.tick(self._safety.at(now_ns), requests=self._requested is not None)
        if contest.is_lost and contest.other:
            self._overruled_by = contest.other
            self._controls.cut(now_ns)
            if not was_lost:  # the zeros after the cut are requests, too
                text = f"overruled by {contest.other}: controls released"
                self._node.event("overruled", "warning", text)
        elif contest.other is None and not self._controls.is_muted(now_ns):
            self._overruled_by = None

    def _report_denied(self) -> None:
        text = "NOT ALLOWED: the router drops our requests; this certificate may only watch"
        self._node.event("barred", "error", text)

    def _read_stick(self, now_ns: int) -> Stick | None:
        before = self._gamepad.status
        stick = self._gamepad.read()
        if self._gamepad.status != before:
            self._node.event("gamepad", "info", f"gamepad: {self._gamepad.status}")
        is_shown = now_ns - self._drawn_ns <= SCREEN_TIMEOUT_S * NS_PER_S
        return stick if is_shown and not self._leaving else None

    def _check_safety(self, now_ns: int) -> None:
        """Release the controls while safety is silent, so that its return moves nothing."""
        if self._safety.at(now_ns) is not None:
            self._unheard = 0
        elif self._unheard is not None:
            self._unheard += 1
            if self._unheard >= UNHEARD_TICKS:
                self._controls.cut(now_ns)
            if self._unheard == UNHEARD_TICKS:
                text = "no state of safety for 1 s: controls released; check it with `t2 doctor`"
                self._node.event("unheard", "warning", text)

    def _start_estop(self, now_ns: int) -> None:
        """Stop; a key that repeats, or a press during the stop, is no further event."""
        state = self._safety.at(now_ns)
        is_known = self._estop.is_pending or (state is not None and "estop" in state.latched)
        self._controls.stop()
        self._bus.estop()
        self._estop.start()
        if not is_known:
            self._node.event("estop", "warning", "emergency stop requested by the operator")

    def _repeat_estop(self, now_ns: int) -> None:
        state = self._safety.at(now_ns)
        step = self._estop.tick(state)
        if step is not EstopStep.NONE:
            self._bus.estop()
        if state is not None and "estop" in state.latched:
            self._unconfirmed = False
        if step is EstopStep.LAST:
            self._unconfirmed = True
            self._node.event(
                "estop_denied" if self._source.denied else "estop_unconfirmed",
                "error",
                self._no_estop,
            )

    @property
    def _no_estop(self) -> str:
        # A certificate that may not drive can rarely stop; the router reports neither.
        denied = ", probably not allowed" if self._source.denied else ""
        return f"EMERGENCY STOP NOT CONFIRMED{denied}: use the vehicle's own switch"

    def _check_terminal(self, now_ns: int) -> None:
        """Release the keys of a terminal that has become slow: buffered presses are old."""
        reason = self.terminal.refusal(now_ns)
        if not reason:
            self._slow = False
        elif self._controls.holds_keys(now_ns):
            self._refuse(reason, now_ns)

    def _refuse(self, reason: str, now_ns: int) -> None:
        self._controls.mute_keys(now_ns)
        if not self._slow:
            self._slow = True
            self._node.event("terminal_slow", "warning", f"keys ignored: {reason}; {ADVICE}")

    def _drop(self, press: Press, now_ns: int) -> None:
        if self._dropped_ns is None or now_ns - self._dropped_ns > NS_PER_S:  # a held key repeats
            self._dropped_ns = now_ns
            text = f"key {press.key.upper()} ignored: it is {press.age_s(now_ns):.1f} s old"
            self._event_log.add("teleop", "warning", text)

    # --- the view -----------------------------------------------------------------------------

    def _on_event(self, arrival: Arrival[Event]) -> None:
        event = arrival.message
        if event.boot != self._bus.boot:  # teleop's own events are in the log already
            service = arrival.key.rpartition("/")[2]
            self._event_log.add(service, event.level, event.text, event.t_ns)

    def _alarm(self, state: SafetyState | None) -> str:
        """Return what the operator must know before anything else; empty for nothing."""
        if self._unconfirmed:
            return self._no_estop
        if self._source.denied:
            return "VIEW ONLY: this certificate may not drive"
        if self._overruled_by:
            return f"OVERRULED by {self._overruled_by}: release the controls"
        return ""

    def _make_view(self, now_ns: int) -> View:
        controls, state = self._controls, self._safety.at(now_ns)
        return View(
            robot=self._bus.robot,
            source=self._settings.source,
            connected=self._bus.connected,
            alarm=self._alarm(state),
            gear=controls.gear,
            turbo=controls.turbo,
            top=twist(Deflection(1, 1), controls.gear, controls.turbo, self._settings),
            requested=self._requested.twist if self._requested else None,
            release=controls.released(now_ns),
            keys_refused=self.terminal.refusal(now_ns),
            gamepad=self._gamepad.status,
            move_stick=controls.gamepad_is_due(now_ns),
            safety=state,
            velocity=self._velocity.at(now_ns),
            odometry=self._odometry.at(now_ns),
            ultrasonic=self._ultrasonic.at(now_ns),
            bumper=self._bumper.at(now_ns),
            link=self._link.at(now_ns),
            left=self._left.at(now_ns),
            right=self._right.at(now_ns),
            lines=self._event_log.lines(),
        )
