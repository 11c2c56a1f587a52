"""Which causes have latched since safety's last word. Pure."""

from common.messages import SafetyState


class Latches:
    """Compares each state of safety with the one before."""

    def __init__(self) -> None:
        self._known: set[str] | None = None  # None until the first state

    def take(self, state: SafetyState) -> list[str]:
        """Return what is latched now and was not before.

        What was latched before the first state is an old story: its minutes are not in memory.
        """
        now = set(state.latched)
        new = [] if self._known is None else sorted(now - self._known)
        self._known = now
        return new
