"""The operator's calls to safety: reset, and release off a pressed bumper; in the node's loop."""

from msgspec.structs import replace

from common import keys, operator
from common.messages import Direction, Done, Level, ResetDone, SafetyState
from common.service import Node
from services.teleop.config import TeleopConfig
from services.teleop.event_log import Logbook
from services.teleop.reset_check import ResetCheck

RESET_TIMEOUT_S = 1.0  # safety refuses a reset that is older anyway
RELEASE_TIMEOUT_S = 0.3
RELEASED = "released"  # whatever distance is left
NO_STATE = "no fresh state of safety"
NOT_CONFIRMED = (
    "RESET NOT CONFIRMED: an answer came, but safety's state does not show its effect: "
    "look at the vehicle, then at `t2 services`"
)


class OperatorCalls:
    """Makes one call of each kind at a time, and adds its result to the event log."""

    def __init__(self, node: Node[TeleopConfig], logbook: Logbook) -> None:
        self._node = node
        self._bus = node.bus
        self._logbook = logbook
        self._reset: ResetCheck | None = None
        self._direction: Direction | None = None  # requested last; None when ended
        self._pending = False  # a release call without its answer
        self._logged = ""  # what was logged last of the release under way
        self._ended: tuple[int, int] | None = None  # the state that the last end echoed

    # --- reset --------------------------------------------------------------------------------

    def reset(self, shown: SafetyState | None, newest: SafetyState | None) -> None:
        """Clear the causes that the screen showed, while the state of safety is fresh."""
        if shown is None or newest is None:
            self._add("warning", f"reset not sent: {NO_STATE}")
            return
        if self._reset is not None and not self._reset.is_answered:
            return  # a held key repeats
        self._reset = check = ResetCheck(shown)
        self._bus.ask(
            keys.RESET,
            replace(operator.reset_request(shown), echo=newest.heartbeat),
            lambda done: self._reset_answered(check, done),
            lambda reason: self._reset_refused(check, reason),
            timeout_s=RESET_TIMEOUT_S,
        )

    def check_reset(self, state: SafetyState | None, now_ns: int) -> None:
        """Report an unconfirmed reset."""
        if self._reset is None:
            return
        outcome = self._reset.outcome(state, now_ns)
        if outcome is None:
            return
        self._reset = None
        if not outcome:
            self._node.event("reset_unconfirmed", "error", NOT_CONFIRMED)

    def _reset_answered(self, check: ResetCheck, done: ResetDone) -> None:
        check.answer(done)
        self._add("info", f"reset: {done.text}")

    def _reset_refused(self, check: ResetCheck, reason: str) -> None:
        if self._reset is check:
            self._reset = None
        self._add("warning", f"reset refused: {reason}")

    # --- release ------------------------------------------------------------------------------

    def release(self, direction: Direction | None, newest: SafetyState | None) -> None:
        """Repeat the call while a direction is held; end it on release or change."""
        if self._direction is not None and direction != self._direction:
            self._end_release(newest)
        if direction is None:
            return
        self._direction = direction
        if newest is None:
            self._log_once("warning", f"release not sent: {NO_STATE}")
        elif not self._pending and (newest.boot, newest.heartbeat) != self._ended:
            self._pending = True
            self._bus.ask(
                keys.RELEASE,
                operator.release_request(newest, direction, held=True),
                self._release_held,
                self._release_refused,
                timeout_s=RELEASE_TIMEOUT_S,
            )

    def _end_release(self, newest: SafetyState | None) -> None:
        self._direction, self._logged = None, ""
        # Safety refuses a new hold with the echo of this end.
        self._ended = (newest.boot, newest.heartbeat) if newest else None
        self._bus.ask(
            keys.RELEASE,
            operator.release_request(newest, None, held=False),
            lambda _: None,
            lambda _: None,
            timeout_s=RELEASE_TIMEOUT_S,
        )

    def _release_held(self, done: Done) -> None:
        """Log the first answer of a release; the distance that is left is on the screen."""
        self._pending = False
        self._log_once("info", f"release: {done.text}", RELEASED)

    def _release_refused(self, reason: str) -> None:
        self._pending = False
        self._log_once("warning", f"release refused: {reason}")

    def _log_once(self, level: Level, text: str, what: str = "") -> None:
        """Log the result of the release under way, once."""
        if self._direction is not None and (what or text) != self._logged:
            self._logged = what or text
            self._add(level, text)

    def _add(self, level: Level, text: str) -> None:
        self._logbook.add("safety", level, text)
