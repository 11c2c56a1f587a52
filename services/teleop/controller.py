"""Controller of teleop: combines keys, gamepad and bus in the node's loop.

The screen runs in another thread. It posts key presses to this loop and reads ``view``. A slow
terminal can therefore delay a key, but never a zero request. ``Controls`` decides what counts.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

from msgspec.structs import replace

from common import clock
from common.bus.bus import Arrival, no_answer, not_allowed
from common.bus.session import is_viewer, operator_name
from common.cli_args import hint
from common.freshness import NS_PER_S, Latest, fresh
from common.root_cause import MAY_MOVE, TEXTS, root_cause
from common.service import Node
from common.source import DriveSource
from services.teleop.config import TeleopConfig
from services.teleop.core.controls import (
    ACKNOWLEDGE,
    ESTOP,
    MAX_PRESS_AGE_S,
    Action,
    Controls,
    Stick,
)
from services.teleop.core.hold import GAMEPAD_SILENCE_S, Press
from services.teleop.core.keystroke import no_function
from services.teleop.gamepad import Gamepad
from services.teleop.view import LINES, EventLog, View
from t2 import keys
from t2.client import (
    ESTOP_TICKS,
    ESTOP_WAIT_S,
    Contest,
    EstopRepetition,
    EstopStep,
    ResetCheck,
    reset_request,
)
from t2.messages import Drive, Event, EventName, Field, Phrase, Refusal, ResetDone, SafetyState

PERIOD_S = 0.05  # 20 Hz, which safety's lease of 0.3 s requires
WAIT_TICKS = round(ESTOP_WAIT_S / PERIOD_S) + 1  # its age ends it first
OWN_SWITCH = "use the vehicle's own switch"
SCREEN_TIMEOUT_S = 1.0  # without a redraw the screen hangs: the gamepad is released
UNHEARD_S = 0.5  # without a fresh state of safety; with its own 0.5 s this is 1 s
RESET_TIMEOUT_S = 1.0  # safety refuses an older reset
UNHEARD = "no state of safety for 1 s: controls released"
NOT_CONFIRMED = (
    "RESET NOT CONFIRMED: safety's state does not show the effect of the reset; "
    "look at the vehicle, then at `t2 ls --services`"
)
# The topics of the view, and how long (s) their last message is shown.
TOPICS: dict[str, tuple[Any, float, str]] = {
    "safety": (keys.SAFETY, 0.5, ""),
    "velocity": (keys.VELOCITY, 0.5, ""),
    "odometry": (keys.ODOMETRY, 0.5, ""),
    "ultrasonic": (keys.ULTRASONIC, 0.5, ""),
    "bumper": (keys.BUMPER, 0.5, ""),
    "link": (keys.LINK, 1.0, ""),
    "left": (keys.DRIVER, 2.0, "left"),
    "right": (keys.DRIVER, 2.0, "right"),
}


class Controller:
    """Key presses in, requests out, and a view of the state; all methods in the loop's thread."""

    def __init__(
        self, node: Node[TeleopConfig], event_log: EventLog, words: Sequence[str] = ()
    ) -> None:
        """``words`` are the options that name sources of settings, for hints."""
        self._doctor = hint("doctor", words)
        self._node, self._bus, self._event_log = node, node.bus, event_log
        self._settings = node.config.teleop
        self._operator = operator_name(self._bus.where)
        self._may_stop = not is_viewer(self._bus.where)
        self._controls = Controls(self._settings, node.config.vehicle)
        self.terminal = self._controls.terminal
        self._gamepad = Gamepad("searching")
        self._drawn_ns = 0  # the last redraw of the screen
        self._requested: Drive | None = None
        self._leaving = False
        self._key_notice = ""  # of a key without a function, until the next key
        self._reported: set[str] = set()  # rules that are broken, and in the event log
        self._heard_ns: int | None = None  # the last tick with a fresh state of safety
        self._estop = EstopRepetition()
        self._contest = Contest(self._settings.source)
        self._overruled_by: str | None = None  # while that source drives
        self._estop_ns = 0  # the last press
        self._estop_sent = False  # whether there was a router since the press
        self._unconfirmed = False  # whether safety has not shown our emergency stop for 3 s
        self._lapsed = ""  # what became of an emergency stop that is repeated no longer
        self._reset: ResetCheck | None = None
        self._source = DriveSource(self._bus, self._settings.source, self._report_denied)
        self._latest: dict[str, Latest[Any]] = {}  # messages, by the names of TOPICS
        for name, (topic, _, side) in TOPICS.items():
            self._bus.subscribe(topic, partial(self._on_message, name), side=side)
        self._bus.subscribe(keys.EVENTS, self._on_event, depth=LINES, service="*")
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
        """Process a key press or its repeat."""
        if self._leaving and press.key != ESTOP:
            return
        if press.key == ACKNOWLEDGE:
            self._lapsed = ""
        action = self._controls.press(press, now_ns)
        if action is Action.ESTOP:
            self._start_estop(self._state(now_ns), now_ns)
        elif action is Action.RESET:
            self._start_reset(press.shown, self._state(now_ns))
        elif action is Action.SLOW:
            self._report("terminal_slow", *self.terminal.refusal(press.at_ns))
        self._report_key(press.key, action)

    def _report_key(self, key: str, action: Action) -> None:
        self._key_notice = no_function(key) if action is Action.UNKNOWN else ""
        text = self._key_notice
        if action is Action.LATE:
            text = f"key {key.upper()} ignored: it is older than {MAX_PRESS_AGE_S:g} s"
        if text:
            self._event_log.add("teleop", "warning", text)

    def release_controls(self, now_ns: int) -> None:
        """Release keys and gamepad: the terminal has lost the focus."""
        self._controls.enforce("unfocused", now_ns)

    def leave(self) -> None:
        """Stop the loop after the final zeros, and after a pending emergency stop."""
        if not self._leaving:
            self._leaving = True
            self._estop.ticks = min(self._estop.ticks, ESTOP_TICKS)
            self._controls.stop(clock.now_ns())

    # --- the loop ---------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Send the requests of this tick and renew the view."""
        if self._leaving and self._controls.is_silent and not self._estop.is_pending:
            self._node.loop.stop()
            return
        state = self._state(now_ns)
        self._enforce_rules(state, now_ns)
        was_silent = self._controls.is_silent
        self._requested = self._controls.tick(self._read_stick(now_ns), now_ns)
        if was_silent and not self._controls.is_silent and (other := self._contest.other):
            self._node.event("take_over", "info", by=self._operator, other=other)
        if self._requested is not None:
            self._source.put(self._requested)
        self._repeat_estop(state, now_ns)
        self._check_reset(state, now_ns)
        self.view = self._make_view(now_ns)

    def _enforce_rules(self, state: SafetyState | None, now_ns: int) -> None:
        """Release the controls by the rules of ``hold``, so that nothing old moves the vehicle."""
        # A program that was suspended has a fresh state at once, and controls from before.
        unheard_s = (now_ns - (self._heard_ns or now_ns)) / NS_PER_S
        self._enforce("unheard", unheard_s > UNHEARD_S, now_ns, seconds=1.0)
        if state is not None:
            self._heard_ns = now_ns
        contest = self._contest
        contest.tick(state, requests=self._requested is not None)
        if contest.is_lost:
            self._overruled_by = contest.other
        elif contest.other is None and not self._controls.is_muted(now_ns):
            self._overruled_by = None
        self._enforce("overruled", contest.is_lost, now_ns, other=contest.other)
        if not (reason := self.terminal.refusal(now_ns)):
            self._reported.discard("terminal_slow")
        elif self._controls.holds_keys(now_ns):
            self._controls.enforce("terminal_slow", now_ns)
            self._report("terminal_slow", *reason)

    def _enforce(self, rule: EventName, is_broken: bool, now_ns: int, **about: Field) -> None:
        if is_broken:
            self._controls.enforce(rule, now_ns)
            self._report(rule, **about)
        else:
            self._reported.discard(rule)

    def _report(self, rule: EventName, *phrases: Phrase, **about: Field) -> None:
        """Report a rule once, until it holds again."""
        if rule not in self._reported:
            self._reported.add(rule)
            self._node.event(rule, "warning", *phrases, **about)

    def _read_stick(self, now_ns: int) -> Stick | None:
        before = self._gamepad.status
        stick = self._gamepad.read()
        if self._gamepad.status != before:
            self._node.event("gamepad", "info", device=self._gamepad.status)
        if self._controls.is_gamepad_silent:
            self._report("gamepad_silent", seconds=GAMEPAD_SILENCE_S)
        else:
            self._reported.discard("gamepad_silent")
        self._report_ignored(self._gamepad.ignored)
        is_drawn = now_ns - self._drawn_ns <= SCREEN_TIMEOUT_S * NS_PER_S
        is_shown = is_drawn and not self.terminal.has_stopped(now_ns)
        return stick if is_shown and not self._leaving else None

    def _report_ignored(self, axes: dict[int, float]) -> None:
        """Report axes that are off centre, once for each press of the deadman."""
        if axes and "off_centre" not in self._reported:
            for axis, position in axes.items():
                text = (
                    f"gamepad: axis {axis} is at {position:.2f} as the deadman goes down: ignored; "
                )
                text += "centre it and press again, or correct teleop.*_axis or teleop.deadzone"
                self._event_log.add("teleop", "warning", text)
        (self._reported.add if axes else self._reported.discard)("off_centre")

    # --- emergency stop -----------------------------------------------------------------------

    def _start_estop(self, state: SafetyState | None, now_ns: int) -> None:
        """Stop; a key that repeats, or a press during the stop, is no further event."""
        is_known = self._estop.is_pending or (state is not None and "estop" in state.latched)
        self._bus.estop()
        self._estop.start(state, ESTOP_TICKS if self._leaving else WAIT_TICKS)
        self._estop_ns, self._estop_sent, self._lapsed = now_ns, self._bus.connected, ""
        if not is_known:
            self._node.event("estop", "warning", by=self._operator)

    def _repeat_estop(self, state: SafetyState | None, now_ns: int) -> None:
        """Repeat a stop until it is confirmed or too old; a suspended program sends no old one."""
        if self._estop.is_pending and self._estop_left_s(now_ns) <= 0:
            self._estop.ticks, self._unconfirmed = 0, False
            what = "IS NOT CONFIRMED" if self._estop_sent else "WAS NOT SENT"
            self._lapsed = f"YOUR E-STOP {what}: press E again; {OWN_SWITCH}"
            self._event_log.add("teleop", "error", self._lapsed)
        step = self._estop.tick(state)
        if step is not EstopStep.NONE:
            self._bus.estop()
            self._estop_sent = self._estop_sent or self._bus.connected
        if state is not None and "estop" in state.latched:
            self._unconfirmed = False
        elif self._estop.ticks == WAIT_TICKS - ESTOP_TICKS or step is EstopStep.LAST:
            self._report_unconfirmed()

    def _estop_left_s(self, now_ns: int) -> float:
        return ESTOP_WAIT_S - (now_ns - self._estop_ns) / NS_PER_S

    def _report_unconfirmed(self) -> None:
        if not self._unconfirmed:
            self._unconfirmed = True
            name: EventName = "estop_denied" if self._source.denied else "estop_unconfirmed"
            self._node.event(name, "error")

    @property
    def unconfirmed(self) -> str:
        """What safety has not confirmed, for the operator; empty for nothing."""
        if self._lapsed or not self._unconfirmed:
            return self._lapsed
        # A certificate that may not drive can rarely stop; the router reports neither.
        denied = ", probably not allowed" if self._source.denied else ""
        return f"EMERGENCY STOP NOT CONFIRMED{denied}: {OWN_SWITCH}"

    # --- reset --------------------------------------------------------------------------------

    def _start_reset(self, shown: SafetyState | None, newest: SafetyState | None) -> None:
        """Clear the causes that the screen showed, while the state of safety is fresh."""
        if shown is None or newest is None:
            text = "reset not sent: no fresh state of safety"
            self._event_log.add("teleop", "warning", text)
            return
        if self._reset is not None and not self._reset.is_answered:
            return  # a held key repeats
        self._reset = check = ResetCheck(shown)
        self._node.event("reset_request", "info", by=self._operator)
        self._bus.call(
            keys.RESET,
            replace(reset_request(shown), echo=newest.heartbeat),
            lambda done: self._reset_answered(check, done),
            lambda refusal: self._reset_refused(check, refusal),
            timeout_s=RESET_TIMEOUT_S,
        )

    def _reset_answered(self, check: ResetCheck, done: ResetDone) -> None:
        check.answer(done)
        self._event_log.add("safety", "info", done.text)

    def _reset_refused(self, check: ResetCheck, refusal: Refusal) -> None:
        if self._reset is check:
            self._reset = None
        if refusal == no_answer("safety") and self._source.denied:
            refusal = not_allowed("safety")
        self._event_log.add("safety", "warning", refusal.text)

    def _check_reset(self, state: SafetyState | None, now_ns: int) -> None:
        """Report an unconfirmed reset."""
        outcome = self._reset.outcome(state, now_ns) if self._reset else None
        if outcome is not None:
            self._reset = None
        if outcome is False:
            self._node.event("reset_unconfirmed", "error")

    # --- the view -----------------------------------------------------------------------------

    def _on_event(self, arrival: Arrival[Event]) -> None:
        event = arrival.message
        if event.boot != self._bus.boot:  # teleop's own events are in the log already
            service = arrival.key.rpartition("/")[2]
            self._event_log.add(service, event.level, event.text, event)

    def _report_denied(self) -> None:
        self._node.event("barred", "error")

    def _on_message(self, name: str, arrival: Arrival[Any]) -> None:
        self._latest[name] = Latest(arrival.message, arrival.received_ns)

    def _newest(self, name: str, now_ns: int) -> Any:
        """Return the newest message of a topic; None once it is too old to show."""
        latest = self._latest.get(name)
        return latest.value if latest and fresh(latest, now_ns, TOPICS[name][1]) else None

    def _state(self, now_ns: int) -> SafetyState | None:
        state: SafetyState | None = self._newest("safety", now_ns)
        return state

    def _estop_alarm(self, now_ns: int) -> str:
        left = f"{max(0, self._estop_left_s(now_ns)):.0f} s"
        if self._lapsed:
            return f"{self._lapsed}. Enter: understood"
        if self._estop.is_pending and not self._bus.connected:
            return (
                f"EMERGENCY STOP NOT SENT YET: no router. {OWN_SWITCH.capitalize()}. "
                f"It is sent if the router is back within {left}"
            )
        return f"{self.unconfirmed}; it is repeated for {left}" if self._unconfirmed else ""

    def _alarm(self, state: SafetyState | None, now_ns: int) -> str:
        """Return what the operator must know before anything else; empty for nothing."""
        if alarm := self._estop_alarm(now_ns):
            return alarm
        if root_cause(self._bus.connected, state, self._newest("link", now_ns)).part in TEXTS:
            return MAY_MOVE
        if not self._may_stop:
            return "VIEW ONLY, and no emergency stop: use the vehicle's own switch"
        if self._source.denied:
            return "VIEW ONLY: this certificate may not drive, and perhaps not stop"
        by = self._overruled_by
        return f"OVERRULED by {by}: release the controls" if by else ""

    def _gamepad_notice(self, now_ns: int) -> str:
        if self._controls.is_gamepad_due(now_ns):
            return "no change: MOVE THE STICK"
        if self._controls.is_gamepad_silent:
            return "FROZEN: release the deadman"
        axes = ", ".join(map(str, self._gamepad.ignored))
        return f"OFF CENTRE, ignored: axis {axes}" if axes else ""

    def _make_view(self, now_ns: int) -> View:
        controls = self._controls
        return View(
            robot=self._bus.robot,
            source=self._settings.source,
            connected=self._bus.connected,
            router=", ".join(self._bus.where.endpoints),
            doctor=self._doctor,
            may_drive=self._may_stop and not self._source.denied,
            may_stop=self._may_stop,
            alarm=self._alarm(self._state(now_ns), now_ns),
            gear=controls.gear,
            top=controls.top(),
            requested=self._requested,
            keys_refused=self.terminal.refusal(now_ns),
            key_notice=self._key_notice,
            keys_muted=controls.is_muted(now_ns),
            gamepad=self._gamepad.status,
            gamepad_notice=self._gamepad_notice(now_ns),
            lines=self._event_log.lines(),
            **{name: self._newest(name, now_ns) for name in TOPICS},
        )
