"""The operator's reset: clears what the screen showed, and is confirmed by safety's own state."""

from collections.abc import Callable

from msgspec.structs import replace

from common.bus.bus import Bus, no_answer, not_allowed
from services.teleop.event_log import EventLog, OwnEvents
from t2 import keys
from t2.client import ResetCheck, reset_request
from t2.messages import Phrase, Refusal, ResetDone, SafetyState

TIMEOUT_S = 1.0  # safety refuses an older reset


class OperatorReset:
    """One reset at a time."""

    def __init__(
        self, bus: Bus, event_log: EventLog, report: OwnEvents, is_denied: Callable[[], bool]
    ) -> None:
        """``is_denied`` returns whether this certificate may not drive."""
        self._bus, self._event_log, self._report = bus, event_log, report
        self._is_denied = is_denied
        self._check: ResetCheck | None = None

    def start(self, shown: SafetyState | None, newest: SafetyState | None, operator: str) -> None:
        """Clear the causes that the screen showed, while the state of safety is fresh."""
        if shown is None or newest is None:
            self._report.note("warning", Phrase("reset.not_sent"))
            return
        if self._check is not None and not self._check.is_answered:
            return  # a held keystroke repeats
        self._check = check = ResetCheck(shown)
        self._report("reset_request", "info", by=operator)
        self._bus.call(
            keys.RESET,
            replace(reset_request(shown), echo=newest.heartbeat),
            lambda done: self._answered(check, done),
            lambda refusal: self._refused(check, refusal),
            timeout_s=TIMEOUT_S,
        )

    def tick(self, state: SafetyState | None, now_ns: int) -> None:
        """Report a reset that safety's state does not confirm."""
        outcome = self._check.outcome(state, now_ns) if self._check else None
        if outcome is not None:
            self._check = None
        if outcome is False:
            self._report("reset_unconfirmed", "error")

    def _answered(self, check: ResetCheck, done: ResetDone) -> None:
        check.answer(done)
        self._event_log.add("safety", "info", done.phrases, done.text)

    def _refused(self, check: ResetCheck, refusal: Refusal) -> None:
        if self._check is check:
            self._check = None
        if refusal.phrases == no_answer("safety").phrases and self._is_denied():
            refusal = not_allowed("safety")
        self._event_log.add("safety", "warning", refusal.phrases, refusal.text)
