"""The driver's desk: hands and bus come together here, in the node's loop.

The screen lives in another thread. It posts presses here and reads ``view``; a slow terminal can
therefore delay a key, but never a zero.
"""

import time

from common import keys
from common.bus.bus import Arrival
from common.freshness import NS_PER_S
from common.messages import Event
from common.motion import Twist
from common.service import Node
from common.source import DriveSource
from services.teleop.config import TeleopConfig
from services.teleop.controls import RELEASE, STOP, Controls
from services.teleop.event_log import Logbook
from services.teleop.gamepad import Gamepad, NoGamepad
from services.teleop.hold import Press
from services.teleop.mapping import DIRECTIONS, Deflection, Stick, twist
from services.teleop.operator_calls import OperatorCalls
from services.teleop.round_trip import ADVICE, RoundTrip
from services.teleop.view import Ear, View

PERIOD_S = 0.05  # 20 Hz, as safety's lease of 0.3 s wants it
WATCHED_S = 1.0  # a screen that stands still for longer is a lost terminal: no gamepad then
WAIT_S = 0.5  # a press that waited longer is ignored, except a stop
LINES = 40
UNHEARD_TICKS = 10  # without a fresh word of safety: with its own 0.5 s, the bus is lost after 1 s
ESTOP_TICKS = 60  # an emergency stop is repeated until safety says that it is latched, or 3 s
ESTOP, RESET = "e", "r"
BY_TERMINAL = {*DIRECTIONS, *RELEASE, RESET}  # the keys that need a fast terminal
FAST_S, LINK_S, SLOW_S = 0.5, 1.0, 2.0  # how long a stream's last value is worth showing


class Desk:
    """Presses in, requests out, and a picture of it all; every method in the loop's thread."""

    def __init__(self, node: Node[TeleopConfig], logbook: Logbook, unmeasurable: str = "") -> None:
        self._node = node
        self._bus = bus = node.bus
        self._settings = node.config.teleop
        self._logbook = logbook
        self._controls = Controls(self._settings)
        self._gamepad: Gamepad = NoGamepad("looking")
        self._watched_ns = 0
        self._asked: Twist | None = None
        self._calls = OperatorCalls(node, logbook)
        self._leaving = False
        self.terminal = RoundTrip(self._settings.round_trip, unmeasurable)
        self._slow = False  # a warning that the keys do not count was shown
        self._dropped_ns: int | None = None  # when a late press was last reported
        self._unheard: int | None = None  # ticks; None before safety was heard at all
        self._estops = 0  # ticks for which the emergency stop is still repeated
        self._source = DriveSource(bus, self._settings.source)
        self._safety = Ear(bus, keys.SAFETY, FAST_S)
        self._velocity = Ear(bus, keys.VELOCITY, FAST_S)
        self._odometry = Ear(bus, keys.ODOMETRY, FAST_S)
        self._ultrasonic = Ear(bus, keys.ULTRASONIC, FAST_S)
        self._bumper = Ear(bus, keys.BUMPER, FAST_S)
        self._link = Ear(bus, keys.LINK, LINK_S)
        self._left = Ear(bus, keys.DRIVER, SLOW_S, side="left")
        self._right = Ear(bus, keys.DRIVER, SLOW_S, side="right")
        bus.subscribe(keys.EVENTS, self._hear_event, depth=LINES, service="*")
        self.view = self._picture(time.monotonic_ns())
        node.loop.every(PERIOD_S, self.tick)

    # --- what the screen and the shell call -----------------------------------------------

    def plug(self, gamepad: Gamepad) -> None:
        """Drive by this gamepad, too."""
        self._gamepad = gamepad

    def watch(self, now_ns: int) -> None:
        """Note that the screen is alive."""
        self._watched_ns = now_ns

    def press(self, press: Press, now_ns: int) -> None:
        """Take a key press or its repeat; one that comes late stops the vehicle, or does nothing.

        ========== ========================= ======================== ===============
        key        waited over ``WAIT_S``    terminal refused         else
        ========== ========================= ======================== ===============
        E, space   counts                    counts                   counts
        R          ignored, with a line      ignored, with an event   counts
        motion     ignored, with a line      muted, with an event     counts
        others     ignored, with a line      counts                   counts
        ========== ========================= ======================== ===============
        """
        if self._leaving:
            return
        if press.key == ESTOP:
            self._estop()
        elif press.key == STOP:
            self._controls.press(STOP, now_ns)
        elif press.age_s(now_ns) > WAIT_S:
            self._drop(press, now_ns)
        elif press.key in BY_TERMINAL and (reason := self.terminal.refusal(press.at_ns)):
            self._refuse(reason, now_ns)
        elif press.key == RESET:
            self._calls.reset(press.shown, self._safety.at(now_ns))
        else:
            self._controls.press(press.key, press.at_ns)

    def let_go(self) -> None:
        """Release keys and gamepad, as when the terminal loses the focus."""
        self._controls.let_go()

    def leave(self) -> None:
        """Send the last zeros; the loop stops after them."""
        if not self._leaving:
            self._leaving = True
            self._controls.stop()

    # --- the loop ---------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Send what is due and draw the picture anew."""
        if self._leaving and self._controls.silent:
            self._node.loop.stop()
            return
        self._notice_silence(now_ns)
        self._notice_slow_terminal(now_ns)
        self._repeat_estop(now_ns)
        self._drive(now_ns)
        self._calls.release(self._controls.released(now_ns), self._safety.at(now_ns))
        self._calls.check_reset(self._safety.at(now_ns), now_ns)
        self.view = self._picture(now_ns)

    def _drive(self, now_ns: int) -> None:
        had_expired = self._controls.gamepad_expired
        self._asked = self._controls.tick(self._read_stick(now_ns), now_ns)
        if self._asked is not None:
            self._ask(self._asked)
        if self._controls.gamepad_expired and not had_expired:
            text = (
                f"gamepad released: deflected, and no event for {self._settings.gamepad_silence:g} "
                "s; release the deadman, then press it again"
            )
            self._node.event("gamepad_silent", "warning", text)

    def _ask(self, request: Twist) -> None:
        was_barred = self._source.barred
        self._source.ask(request.linear, request.angular)
        if self._source.barred and not was_barred:
            text = "NOT ALLOWED: the router drops our requests; this certificate may only watch"
            self._node.event("barred", "error", text)

    def _read_stick(self, now_ns: int) -> Stick | None:
        before = self._gamepad.words
        stick = self._gamepad.read()
        if self._gamepad.words != before:
            self._node.event("gamepad", "info", f"gamepad: {self._gamepad.words}")
        watched = now_ns - self._watched_ns <= WATCHED_S * NS_PER_S and not self._leaving
        return stick if watched else None

    def _notice_silence(self, now_ns: int) -> None:
        """Let go of everything while safety is not heard: what comes back must not drive."""
        if self._safety.at(now_ns) is not None:
            self._unheard = 0
        elif self._unheard is not None:
            self._unheard += 1
            if self._unheard >= UNHEARD_TICKS:
                self._controls.cut(now_ns)
            if self._unheard == UNHEARD_TICKS:
                self._node.event("unheard", "warning", "safety is not heard: controls released")

    def _estop(self) -> None:
        self._controls.stop()
        self._bus.estop()
        self._estops = ESTOP_TICKS
        self._node.event("estop", "warning", "emergency stop asked by the operator")

    def _repeat_estop(self, now_ns: int) -> None:
        """Ask again until safety has latched it; one message on a bus may be lost."""
        if not self._estops:
            return
        safety = self._safety.at(now_ns)
        if safety is not None and "estop" in safety.latched:
            self._estops = 0
            return
        self._bus.estop()
        self._estops -= 1
        if not self._estops:
            text = "EMERGENCY STOP NOT CONFIRMED by safety: use the vehicle's own switch"
            self._node.event("estop_unconfirmed", "error", text)

    def _notice_slow_terminal(self, now_ns: int) -> None:
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
            text = f"key {press.key.upper()} ignored: it waited {press.age_s(now_ns):.1f} s"
            self._logbook.add("teleop", "warning", text)

    # --- the picture --------------------------------------------------------------------------

    def _hear_event(self, arrival: Arrival[Event]) -> None:
        event = arrival.message
        if event.boot != self._bus.boot:  # our own are in the logbook already
            service = arrival.key.rpartition("/")[2]
            self._logbook.add(service, event.level, event.text, event.t_ns)

    def _picture(self, now_ns: int) -> View:
        controls = self._controls
        return View(
            robot=self._bus.robot,
            source=self._settings.source,
            connected=self._bus.connected,
            gear=controls.gear,
            turbo=controls.turbo,
            top=twist(Deflection(1, 1), controls.gear, controls.turbo, self._settings),
            asked=self._asked,
            release=controls.released(now_ns),
            keys_refused=self.terminal.refusal(now_ns),
            gamepad=self._gamepad.words,
            move_stick=controls.gamepad_is_due(now_ns),
            safety=self._safety.at(now_ns),
            velocity=self._velocity.at(now_ns),
            odometry=self._odometry.at(now_ns),
            ultrasonic=self._ultrasonic.at(now_ns),
            bumper=self._bumper.at(now_ns),
            link=self._link.at(now_ns),
            left=self._left.at(now_ns),
            right=self._right.at(now_ns),
            lines=self._logbook.last(LINES),
        )
