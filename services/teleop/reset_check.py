"""One reset, from its request to the safety state that confirms it.

======== ============================== ================================================
phase    event                          outcome
======== ============================== ================================================
asked    refusal, or no answer          refused, with the reason
asked    answer                         wait for a state, at most ``CONFIRM_S``
answered a state that confirms          reset, with the answer's text
answered ``CONFIRM_S`` over             RESET NOT CONFIRMED
======== ============================== ================================================

Any program on the bus may answer the call; only safety's own state shows that a latch is cleared.
"""

from common import operator
from common.freshness import NS_PER_S
from common.messages import ResetDone, SafetyState


class ResetCheck:
    """A reset that is under way."""

    def __init__(self, seen: SafetyState) -> None:
        self._seen = seen
        self._done: ResetDone | None = None
        self._until_ns: int | None = None

    @property
    def is_answered(self) -> bool:
        """Whether an answer came, so that only safety's state is missing."""
        return self._done is not None

    def answer(self, done: ResetDone) -> None:
        """Take the answer; from the next ``outcome`` on a state has to confirm it."""
        self._done = done

    def outcome(self, state: SafetyState | None, now_ns: int) -> bool | None:
        """Return whether the reset is confirmed by this state; None while that is open."""
        if self._done is None:
            return None
        if state is not None and operator.confirms(self._seen, self._done, state):
            return True
        if self._until_ns is None:
            self._until_ns = now_ns + round(operator.CONFIRM_S * NS_PER_S)
        return False if now_ns > self._until_ns else None
