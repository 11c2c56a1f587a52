"""The newest diagnostic status of each part; a silent part is stale. Pure."""

from collections.abc import Callable

from common.freshness import NS_PER_S
from services.ros2.cdr import Value

STALE, STALE_NS = 3, 3 * NS_PER_S
ONCE = "t2: cmd_vel"  # noted on a change, not periodically


class Diagnostics:
    """Statuses by name, with the time of each."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._statuses: dict[str, tuple[Value, int]] = {}

    def note(self, status: Value) -> None:
        """Replace the status of the same name."""
        self._statuses[status[1]] = (status, self._clock())

    def statuses(self, now_ns: int) -> tuple[Value, ...]:
        """Return all statuses, the silent ones as stale."""
        return tuple(
            (STALE, name, f"Silent. Last: {status[2]}", *status[3:])
            if now_ns - noted_ns > STALE_NS and name != ONCE
            else status
            for name, (status, noted_ns) in sorted(self._statuses.items())
        )
