"""The operator's emergency stop: sent on E, repeated until safety has latched it, and its alarms.

========== ======================================== ==============================================
phase      until                                    alarm
========== ======================================== ==============================================
not sent   there is a router, or 30 s are over      not sent yet, with the seconds that are left
repeated   safety has latched it, or 30 s are over  after 3 s: not confirmed
lapsed     E or Enter                               was not sent, or is not confirmed
========== ======================================== ==============================================
"""

from collections.abc import Callable

from common.bus.bus import Bus
from common.freshness import NS_PER_S
from services.teleop.event_log import OwnEvents
from t2.client import ESTOP_TICKS, ESTOP_WAIT_S, EstopRepetition, EstopStep
from t2.messages import EventName, Phrase, Phrases, SafetyState

PERIOD_S = 0.05  # of the ticks
WAIT_TICKS = round(ESTOP_WAIT_S / PERIOD_S) + 1  # its age ends it first


class OperatorEstop:
    """One emergency stop at a time; ``tick`` runs 20 times a second."""

    def __init__(self, bus: Bus, report: OwnEvents, is_denied: Callable[[], bool]) -> None:
        """``is_denied`` returns whether this certificate may not drive."""
        self._bus, self._report, self._is_denied = bus, report, is_denied
        self._repetition = EstopRepetition()
        self._pressed_ns = 0  # the last press
        self._is_sent = False  # whether there was a router since the press
        self._is_unconfirmed = False  # whether safety has not shown it for 3 s
        self._lapsed: Phrases = ()  # what became of one that is repeated no longer

    @property
    def is_pending(self) -> bool:
        """Whether it is still repeated."""
        return self._repetition.is_pending

    @property
    def unconfirmed(self) -> Phrases:
        """What safety has not confirmed, for the operator; empty for nothing."""
        if self._lapsed or not self._is_unconfirmed:
            return self._lapsed
        return (Phrase(f"event.{self._event}"),)

    @property
    def _event(self) -> EventName:
        # A certificate that may not drive can rarely stop; the router reports neither.
        return "estop_denied" if self._is_denied() else "estop_unconfirmed"

    def start(
        self, state: SafetyState | None, operator: str, now_ns: int, *, leaving: bool
    ) -> None:
        """Stop; a keystroke that repeats, or a press during the stop, is no further event."""
        is_known = self.is_pending or (state is not None and "estop" in state.latched)
        self._bus.estop()
        self._repetition.start(state, ESTOP_TICKS if leaving else WAIT_TICKS)
        self._pressed_ns, self._is_sent, self._lapsed = now_ns, self._bus.connected, ()
        if not is_known:
            self._report("estop", "warning", by=operator)

    def acknowledge(self) -> None:
        """Clear the alarm of one that has lapsed."""
        self._lapsed = ()

    def leave(self) -> None:
        """Wait no longer than for a confirmation: the program ends."""
        self._repetition.ticks = min(self._repetition.ticks, ESTOP_TICKS)

    def tick(self, state: SafetyState | None, now_ns: int) -> None:
        """Repeat it until it is confirmed or too old; a suspended program sends no old one."""
        repetition = self._repetition
        if self.is_pending and self._left_s(now_ns) <= 0:
            repetition.ticks, self._is_unconfirmed = 0, False
            what = "estop.was_not_confirmed" if self._is_sent else "estop.was_not_sent"
            self._lapsed = (Phrase(what),)
            self._report.note("error", *self._lapsed)
        step = repetition.tick(state)
        if step is not EstopStep.NONE:
            self._bus.estop()
            self._is_sent = self._is_sent or self._bus.connected
        if state is not None and "estop" in state.latched:
            self._is_unconfirmed = False
        elif repetition.ticks == WAIT_TICKS - ESTOP_TICKS or step is EstopStep.LAST:
            self._report_unconfirmed()

    def alarm(self, now_ns: int) -> Phrases:
        """Return what the operator must know about it; empty for nothing."""
        left = {"seconds": max(0.0, self._left_s(now_ns))}
        if self._lapsed:
            return *self._lapsed, Phrase("estop.acknowledge")
        if self.is_pending and not self._bus.connected:
            return (Phrase("estop.not_sent_yet", {**left}),)
        if self._is_unconfirmed:
            return *self.unconfirmed, Phrase("estop.repeated", {**left})
        return ()

    def _left_s(self, now_ns: int) -> float:
        return ESTOP_WAIT_S - (now_ns - self._pressed_ns) / NS_PER_S

    def _report_unconfirmed(self) -> None:
        if not self._is_unconfirmed:
            self._is_unconfirmed = True
            self._report(self._event, "error")
