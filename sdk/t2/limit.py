"""Speed limits: a cap or a protective stop, repeated until it ends."""

import math
import threading
import time

import zenoh

from t2.errors import NotAllowed, T2Error
from t2.messages import Limit, LimitState, SafetyState
from t2.motion import finite
from t2.publisher import SourcePublisher
from t2.stream import Stream

PERIOD_S = 0.1
SHOWN_S, POLL_S = 1.0, 0.01  # until safety's state shows a limit; its period is 0.05 s


class SpeedLimit:
    """The limit of one source; a thread repeats it 10 times a second for ``seconds``.

    >>> limit = robot.limit("detector", linear=0.5, seconds=1)
    >>> limit.set(0.2, reason="person close", seconds=1)
    >>> limit.end()
    """

    def __init__(
        self, session: zenoh.Session, key: str, source: str, safety: Stream[SafetyState]
    ) -> None:
        self._publisher = SourcePublisher(session, key, "Limit", safety)
        self._source = source
        self._safety = safety
        self._limit = Limit(echo=0)
        self._end_s = math.inf  # monotonic time
        self._error: Exception | None = None  # of the thread
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"t2 limit {source}", daemon=True)

    @property
    def has_ended(self) -> bool:
        """Whether ``end`` was called, or the thread failed; call ``Robot.limit`` again."""
        return self._ended.is_set()

    def set(
        self,
        linear: float | None,
        angular: float | None = None,
        reason: str = "",
        *,
        seconds: float,
    ) -> None:
        """Replace the limit; send it at once, and repeat it for some seconds or until ``end``.

        Returns and raises as ``Robot.limit``.
        """
        if self.has_ended:
            raise T2Error("this limit has ended; Robot.limit returns another one") from self._error
        linear, angular = (None if cap is None else finite(cap) for cap in (linear, angular))
        if min(finite(seconds), linear or 0.0, angular or 0.0) < 0:
            raise ValueError("caps and seconds must be finite and not negative")
        self._shown()  # raises for an unknown source
        limit = Limit(linear=linear, angular=angular, reason=reason[:80], echo=0)
        begin_s = time.monotonic()
        with self._lock:  # an old limit must not follow a new one
            self._publisher.put(limit)
            self._limit, self._end_s = limit, begin_s + seconds
            if self._thread.ident is None:
                self._thread.start()
        while (passed_s := time.monotonic() - begin_s) < SHOWN_S:
            shown = self._shown()
            is_new = not shown.silent and (shown.age or 0.0) + self._safety.age <= passed_s
            if is_new and (shown.linear, shown.angular) == (linear, angular):
                return
            time.sleep(POLL_S)
        raise NotAllowed(
            f"safety does not show the limit of {self._source!r}: the router admits those of a "
            "certificate of role device with this source, of one program; see `t2 keys list`"
        )

    def end(self) -> None:
        """Send no more; safety treats the silence as its settings for this source say."""
        if self.has_ended:
            return
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._publisher.close()

    def _shown(self) -> LimitState:
        """Return what safety's state shows of this source."""
        states = {each.source: each for each in self._safety.latest().limit_sources}
        if self._source not in states:
            lists = ", ".join(states) or "none"
            raise NotAllowed(f"safety.limits does not list {self._source!r}; it lists {lists}")
        return states[self._source]

    def _run(self) -> None:
        try:
            while not self._ended.wait(PERIOD_S):
                with self._lock:
                    if time.monotonic() < self._end_s:
                        self._publisher.put(self._limit)
        except Exception as error:
            self._error = error
            self._ended.set()
            self._publisher.close()
