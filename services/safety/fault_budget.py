"""A leaky counter: inputs that fail again and again must not be forgiven each time.

A failure costs a whole point; good time earns one back slowly. So failures drain the credit faster
than it refills, and flapping trips although each single failure clears by itself.
"""

from msgspec import Struct

from common.freshness import NS_PER_S

FAILURES = 5.0  # so many close together trip
REFILL_PER_S = 0.1  # one failure is forgiven in ten good seconds


class FaultBudget(Struct, frozen=True):
    """How many failures are still forgiven."""

    left: float = FAILURES
    at_ns: int = 0

    @property
    def is_spent(self) -> bool:
        """Tell whether the next failure is no longer forgiven by itself."""
        return self.left <= 0

    def after(self, now_ns: int, failed: bool, good: bool) -> "FaultBudget":
        """Return the credit by now; ``failed`` when inputs have just gone from good to bad."""
        refill = REFILL_PER_S * (now_ns - self.at_ns) / NS_PER_S if good and self.at_ns else 0.0
        return FaultBudget(max(0.0, min(FAILURES, self.left + refill) - failed), now_ns)
