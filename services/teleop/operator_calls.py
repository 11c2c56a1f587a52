"""The operator's reset, from the call to the state that confirms it; in the node's loop."""

from collections.abc import Callable

from msgspec.structs import replace

from common import keys
from common.messages import Level, ResetDone, SafetyState
from common.operator import ResetCheck, no_answer, not_allowed, reset_request
from common.service import Node
from services.teleop.config import TeleopConfig
from services.teleop.view import EventLog

RESET_TIMEOUT_S = 1.0  # safety refuses an older reset
NO_STATE = "no fresh state of safety"
NOT_CONFIRMED = (
    "RESET NOT CONFIRMED: safety's state does not show the effect of the reset; "
    "look at the vehicle, then at `t2 services`"
)


class OperatorCalls:
    """Makes at most one call at a time and adds its result to the event log."""

    def __init__(
        self, node: Node[TeleopConfig], event_log: EventLog, denied: Callable[[], bool]
    ) -> None:
        """``denied``: whether safety runs and the router drops this certificate's requests."""
        self._node = node
        self._bus = node.bus
        self._event_log = event_log
        self._denied = denied
        self._reset: ResetCheck | None = None

    def reset(self, shown: SafetyState | None, newest: SafetyState | None) -> None:
        """Clear the causes that the screen showed, while the state of safety is fresh."""
        if shown is None or newest is None:
            self._add("warning", f"reset not sent: {NO_STATE}")
            return
        if self._reset is not None and not self._reset.is_answered:
            return  # a held key repeats
        self._reset = check = ResetCheck(shown)
        self._bus.call(
            keys.RESET,
            replace(reset_request(shown), echo=newest.heartbeat),
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
        self._add("warning", f"reset refused: {self._explained(reason)}")

    def _explained(self, reason: str) -> str:
        """Return the reason; for a call that the router drops, that it is not allowed."""
        return not_allowed("safety") if reason == no_answer("safety") and self._denied() else reason

    def _add(self, level: Level, text: str) -> None:
        self._event_log.add("safety", level, text)
