"""Speed limits: a cap or a protective stop, repeated until it ends."""

import math
import threading
import time

import zenoh

from t2.errors import NotAllowed, T2Error
from t2.messages import Limit, SafetyState
from t2.publisher import SourcePublisher
from t2.stream import Stream

PERIOD_S = 0.1


class SpeedLimit:
    """The limit of one source; a thread repeats it 10 times a second until ``end``."""

    def __init__(
        self, session: zenoh.Session, key: str, source: str, safety: Stream[SafetyState]
    ) -> None:
        self._publisher: SourcePublisher[Limit] = SourcePublisher(session, key, "Limit", safety)
        self._source = source
        self._safety = safety
        self._limit = Limit(echo=0)
        self._end_s = math.inf  # monotonic time
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"t2 limit {source}", daemon=True)

    @property
    def has_ended(self) -> bool:
        """Whether ``end`` was called; another limit of the source needs another object."""
        return self._ended.is_set()

    def set(
        self,
        linear: float | None,
        angular: float | None = None,
        reason: str = "",
        seconds: float | None = None,
    ) -> None:
        """Replace the limit; send it at once, and repeat it for some seconds or until ``end``.

        Raises ``NotAllowed``, ``ValueError``, and ``NoData`` without safety.

        >>> limit = robot.limit("detector", linear=0.5)
        >>> limit.set(0.2, reason="person close", seconds=1)
        >>> limit.end()
        """
        if self.has_ended:
            raise T2Error("this limit has ended; Robot.limit returns another one")
        for cap in (linear, angular, seconds):
            if cap is not None and not 0 <= cap < float("inf"):
                raise ValueError(f"caps and seconds must be finite and not negative, not {cap}")
        known = [each.source for each in self._safety.latest().limit_sources]
        if self._source not in known:
            lists = ", ".join(known) or "none"
            raise NotAllowed(f"safety.limits does not list {self._source!r}; it lists {lists}")
        if self._publisher.denied:
            raise NotAllowed(
                f"the router drops the limits of {self._source!r}: it admits those of a "
                "certificate of role device with this source; see `t2 keys`"
            )
        with self._lock:  # an old limit must not follow a new one
            self._limit = Limit(linear=linear, angular=angular, reason=reason[:80], echo=0)
            self._end_s = time.monotonic() + (math.inf if seconds is None else seconds)
            self._publisher.put(self._limit)
        if not self._thread.is_alive():
            self._thread.start()

    def end(self) -> None:
        """Send no more; safety treats the silence as its settings for this source say.

        >>> robot.limit("detector", linear=0.3).end()
        """
        if self.has_ended:
            return
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._publisher.close()

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            with self._lock:
                if time.monotonic() < self._end_s:
                    self._publisher.put(self._limit)
