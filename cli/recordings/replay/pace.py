"""When each message is due."""

import time
from collections.abc import Callable

from common.freshness import NS_PER_S

LOOK_S = 1.0


class Pace:
    """Waits as the recording did, at another speed if so asked.

    ``look`` is called now and then while it waits, and at least once a second.
    """

    def __init__(self, rate: float, look: Callable[[], None]) -> None:
        self._rate = rate
        self._look = look
        self._looked_s = time.monotonic()
        self._began: tuple[float, int] | None = None  # on our clock, on the recording's

    def wait(self, log_ns: int) -> None:
        """Wait until a message of that time is due."""
        if self._began is None:
            self._began = time.monotonic(), log_ns
        begin_s, begin_ns = self._began
        due_s = begin_s + (log_ns - begin_ns) / NS_PER_S / self._rate
        while True:
            now_s = time.monotonic()
            if now_s - self._looked_s >= LOOK_S:
                self._looked_s = now_s
                self._look()
            if now_s >= due_s:
                return
            time.sleep(min(due_s - now_s, LOOK_S))
