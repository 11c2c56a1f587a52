"""Third parties: speed limits, and emergency stops that are kept alive."""

import math
import threading
import time
from collections.abc import Callable, Sequence
from typing import ClassVar

import zenoh

from t2.errors import NotAllowed, T2Error
from t2.messages import Limit, LimitState, SafetyState
from t2.motion import not_negative
from t2.publisher import SourcePublisher
from t2.stream import Stream, now_s

PERIOD_S = 0.1
SHOWN_S, POLL_S = 1.0, 0.01  # until safety's state shows a message; its period is 0.05 s


class Repetition:
    """The messages of one source; a thread repeats the last one, 10 times a second."""

    what: ClassVar[str]  # for texts

    def __init__(
        self, session: zenoh.Session, key: str, source: str, safety: Stream[SafetyState]
    ) -> None:
        self._publisher = SourcePublisher(session, key, Limit, safety)
        self._source = source
        self._safety = safety
        self._message = Limit(echo=0)
        self._end_s = math.inf  # monotonic time
        self._error: Exception | None = None  # of the thread
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=self._run, name=f"t2 {self.what} {source}", daemon=True
        )

    @property
    def has_ended(self) -> bool:
        """Whether ``end`` was called, or the thread failed; ask the robot for another one."""
        return self._ended.is_set()

    def end(self) -> None:
        """Send no more; safety treats the silence as its settings for this source say."""
        if self.has_ended:
            return
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._publisher.close()

    def _repeat(self, message: Limit, seconds: float, is_shown: Callable[[float], bool]) -> None:
        """Send a message at once and for some seconds; return when safety's state shows it.

        ``is_shown`` receives the time in s since the message was sent first.
        """
        if self.has_ended:
            raise T2Error(
                f"this {self.what} has ended; the robot returns another one"
            ) from self._error
        not_negative(seconds, "seconds")
        is_shown(0.0)  # raises for an unknown source
        begin_s = now_s()
        with self._lock:  # an old message must not follow a new one
            self._publisher.put(message)
            self._message, self._end_s = message, begin_s + seconds
            if self._thread.ident is None:
                self._thread.start()
        while (passed_s := now_s() - begin_s) < SHOWN_S:
            if is_shown(passed_s):
                return
            time.sleep(POLL_S)
        self._end_s = -math.inf
        raise NotAllowed(
            f"safety does not show the {self.what} of {self._source!r}: the router admits those "
            "of a certificate of role device with this source, of one program; see `t2 keys list`"
        )

    def _run(self) -> None:
        try:
            while not self._ended.wait(PERIOD_S):
                with self._lock:
                    if now_s() < self._end_s:
                        self._publisher.put(self._message)
        except Exception as error:
            self._error = error
            self._ended.set()
            self._publisher.close()


class SpeedLimit(Repetition):
    """The limit of one source.

    >>> limit = robot.limit("detector", linear=0.5, seconds=1)
    >>> limit.set(0.2, reason="person close", seconds=1)
    >>> limit.end()
    """

    what: ClassVar[str] = "limit"

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
        caps = (linear, angular)
        linear, angular = (None if cap is None else not_negative(cap, "a cap") for cap in caps)

        def is_shown(passed_s: float) -> bool:
            shown = self._shown()
            is_new = not shown.silent and (shown.age or 0.0) + self._safety.age <= passed_s
            return is_new and (shown.linear, shown.angular) == (linear, angular)

        limit = Limit(linear=linear, angular=angular, reason=reason[:80], echo=0)
        self._repeat(limit, seconds, is_shown)

    def _shown(self) -> LimitState:
        return shown(self._source, self._safety.latest().limit_sources)


class Keepalive(Repetition):
    """An emergency stop that is kept alive under one name, as a pendant does.

    >>> pendant = robot.keepalive("pendant", seconds=0.5)  # doctest: +SKIP
    >>> pendant.renew(seconds=0.5)  # doctest: +SKIP
    """

    what: ClassVar[str] = "keepalive"

    def renew(self, *, seconds: float) -> None:
        """Repeat it for some seconds from now. Returns and raises as ``Robot.keepalive``."""

        def is_shown(passed_s: float) -> bool:
            # Alive by another program's messages is not enough.
            return not self._shown().silent and passed_s > 0 and self._publisher.matches

        self._repeat(Limit(echo=0), seconds, is_shown)

    def _shown(self) -> LimitState:
        states = self._safety.latest().limit_sources
        latching = [each for each in states if each.silence == "latch"]
        return shown(self._source, latching, ' with silence = "latch"')


def shown(source: str, states: Sequence[LimitState], which: str = "") -> LimitState:
    """Return what safety's state shows of a source; raise ``NotAllowed`` for an unknown one."""
    known = {each.source: each for each in states}
    if source not in known:
        raise NotAllowed(
            f"safety.limits does not list {source!r}{which}; it lists {', '.join(known) or 'none'}"
        )
    return known[source]
