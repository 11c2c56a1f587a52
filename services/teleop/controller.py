"""Controller of teleop: combines keystrokes, gamepad and bus in the node's loop.

The screen runs in another thread. It posts presses to this loop and reads ``view``. A slow terminal
can therefore delay a keystroke, but never a zero request. ``Controls`` decides what counts.
"""

from collections.abc import Sequence

from common import clock
from common.bus.bus import Arrival
from common.bus.session import is_viewer, operator_name
from common.cli_args import hint
from common.freshness import NS_PER_S
from common.hits import Hits
from common.root_cause import root_cause
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
from services.teleop.estop import PERIOD_S, OperatorEstop
from services.teleop.event_log import LINES, EventLog, OwnEvents
from services.teleop.gamepad import Gamepad
from services.teleop.reset import OperatorReset
from services.teleop.rules import Rules
from services.teleop.telemetry import Telemetry
from services.teleop.view import BELOW_SAFETY, View
from t2 import keys
from t2.messages import Drive, Event, Field, Phrase, Phrases, SafetyState

SCREEN_TIMEOUT_S = 1.0  # without a redraw the screen hangs: the gamepad counts as let go


class Controller:
    """Presses in, requests out, and a view of the state; all methods in the loop's thread."""

    def __init__(
        self, node: Node[TeleopConfig], event_log: EventLog, words: Sequence[str] = ()
    ) -> None:
        """``words`` are the options that name sources of settings, for hints."""
        self._doctor = hint("doctor", words)
        self._node, self._bus, self._event_log = node, node.bus, event_log
        self._settings = node.config.teleop
        self._operator = operator_name(self._bus.where)
        self._may_stop = not is_viewer(self._bus.where)
        self._report = report = OwnEvents(node, event_log)
        self._controls = Controls(self._settings, node.config.vehicle)
        self.terminal = self._controls.terminal
        self._rules = Rules(self._controls, self._settings.source, report)
        self._gamepad = Gamepad(Phrase("gamepad.searching"))
        self._drawn_ns = 0  # the last redraw of the screen
        self._requested: Drive | None = None
        self._leaving = False
        self._keystroke_notice: Phrases = ()  # of one without a function, until the next one
        self._source = DriveSource(self._bus, self._settings.source, self._report_denied)
        self._estop = OperatorEstop(self._bus, report, self._is_denied)
        self._reset = OperatorReset(self._bus, event_log, report, self._is_denied)
        self._telemetry = Telemetry(self._bus)
        self._hits = Hits()
        self._bus.subscribe(keys.EVENTS, self._on_event, depth=LINES, service="*")
        self.view = self._make_view(clock.now_ns())
        node.loop.every(PERIOD_S, self.tick)

    # --- called by the screen and by __main__ -------------------------------------------------

    def use_gamepad(self, gamepad: Gamepad) -> None:
        """Accept this gamepad besides the keyboard."""
        self._gamepad = gamepad

    def screen_drawn(self, now_ns: int) -> None:
        """Note that the screen was redrawn, so the operator still sees it."""
        self._drawn_ns = now_ns

    def press(self, press: Press, now_ns: int) -> None:
        """Process a press or its repeat."""
        if self._leaving and press.keystroke != ESTOP:
            return
        if press.keystroke == ACKNOWLEDGE:
            self._estop.acknowledge()
        action, state = self._controls.press(press, now_ns), self._telemetry.state(now_ns)
        if action is Action.ESTOP:
            self._estop.start(state, self._operator, now_ns, leaving=self._leaving)
        elif action is Action.RESET:
            self._reset.start(press.shown, state, self._operator)
        elif action is Action.SLOW:
            self._rules.report_slow(self.terminal.refusal(press.at_ns))
        self._notice(press.keystroke, action)

    def _notice(self, keystroke: str, action: Action) -> None:
        self._keystroke_notice = no_function(keystroke) if action is Action.UNKNOWN else ()
        notice = self._keystroke_notice
        if action is Action.LATE:
            about: dict[str, Field] = {"keystroke": keystroke.upper(), "limit": MAX_PRESS_AGE_S}
            notice = (Phrase("keystroke.late", about),)
        if notice:
            self._report.note("warning", *notice)

    def let_go(self, now_ns: int) -> None:
        """Let go of keyboard and gamepad: the terminal has lost the focus."""
        self._controls.enforce("unfocused", now_ns)

    def leave(self) -> None:
        """Stop the loop after the final zeros, and after a pending emergency stop."""
        if not self._leaving:
            self._leaving = True
            self._estop.leave()
            self._controls.stop(clock.now_ns())

    @property
    def unconfirmed(self) -> Phrases:
        """What safety has not confirmed, for the operator; empty for nothing."""
        return self._estop.unconfirmed

    # --- the loop ---------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Send the requests of this tick and renew the view."""
        if self._leaving and self._controls.is_silent and not self._estop.is_pending:
            self._node.loop.stop()
            return
        state = self._telemetry.state(now_ns)
        self._rules.enforce(state, now_ns, requests=self._requested is not None)
        was_silent = self._controls.is_silent
        self._requested = self._controls.tick(self._read_stick(now_ns), now_ns)
        if was_silent and not self._controls.is_silent and (other := self._rules.other_driver):
            asked = Phrase("control.asked", {"by": self._operator, "other": other})
            self._report("take_over", "info", asked)
        if self._requested is not None:
            self._source.put(self._requested)
        self._estop.tick(state, now_ns)
        self._reset.tick(state, now_ns)
        self.view = self._make_view(now_ns)

    def _read_stick(self, now_ns: int) -> Stick | None:
        before = self._gamepad.status
        stick = self._gamepad.read()
        status = self._gamepad.status
        if status != before:
            device = status.fields.get("device", status.name.partition(".")[2])
            self._report("gamepad", "info", Phrase("gamepad.status"), status, device=device)
        self._rules.report_gamepad(GAMEPAD_SILENCE_S, self._gamepad.ignored)
        is_drawn = now_ns - self._drawn_ns <= SCREEN_TIMEOUT_S * NS_PER_S
        is_shown = is_drawn and not self.terminal.has_stopped(now_ns)
        return stick if is_shown and not self._leaving else None

    def _on_event(self, arrival: Arrival[Event]) -> None:
        event = arrival.message
        if event.boot != self._bus.boot:  # teleop's own events are in the log already
            service = arrival.key.rpartition("/")[2]
            if not self._hits.is_repeat(service, event):
                self._event_log.add(service, event.level, event.phrases, event.text, event)

    def _is_denied(self) -> bool:
        return self._source.denied

    def _report_denied(self) -> None:
        self._report("barred", "error")

    # --- the view -----------------------------------------------------------------------------

    def _alarm(self, state: SafetyState | None, now_ns: int) -> Phrases:
        """Return what the operator must know before anything else; empty for nothing."""
        if alarm := self._estop.alarm(now_ns):
            return alarm
        link = self._telemetry.newest("link", now_ns)
        if root_cause(self._bus.connected, state, link).part in BELOW_SAFETY:
            return (Phrase("root.may_move"),)
        if not self._may_stop:
            return (Phrase("view_only.no_stop"),)
        if self._source.denied:
            return (Phrase("view_only"),)
        by = self._rules.overruled_by
        return (Phrase("overruled", {"by": by}),) if by else ()

    def _gamepad_notice(self, now_ns: int) -> Phrases:
        if self._controls.is_gamepad_due(now_ns):
            return (Phrase("gamepad.due"),)
        if self._controls.is_gamepad_silent:
            return (Phrase("gamepad.frozen"),)
        axes = tuple(map(str, self._gamepad.ignored))
        return (Phrase("gamepad.ignored", {"axes": axes}),) if axes else ()

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
            alarm=self._alarm(self._telemetry.state(now_ns), now_ns),
            gear=controls.gear,
            top=controls.top(),
            requested=self._requested,
            keyboard_refused=self.terminal.refusal(now_ns),
            keystroke_notice=self._keystroke_notice,
            keyboard_muted=controls.is_muted(now_ns),
            gamepad=self._gamepad.status,
            gamepad_notice=self._gamepad_notice(now_ns),
            lines=self._event_log.lines(),
            **self._telemetry.all(now_ns),
        )
