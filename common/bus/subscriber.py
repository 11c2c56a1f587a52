"""Subscriber of one key: stamps each sample in Zenoh's thread and passes its handling on."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import zenoh
import zenoh.ext

from common import clock
from common.bus.overwriting_queue import OverwritingQueue

Post = Callable[[Callable[[], None]], None]
Take = Callable[[zenoh.Sample, int], None]  # a sample and its receive time, monotonic nanoseconds

# A sample that arrives within this time after its callback returned has probably waited for it.
WAITED_NS = 1_000_000


class Subscriber:
    """Calls ``take`` for each sample, with a queue of ``depth`` that overwrites the oldest one.

    Overwritten samples count as ``overrun``. With ``history`` a late or recovering subscriber gets
    earlier samples, too.
    """

    def __init__(
        self, key: str, take: Take, depth: int, history: int, counters: Counter[str]
    ) -> None:
        self._key = key
        self._take = take
        self._items: OverwritingQueue[tuple[zenoh.Sample, int]] = OverwritingQueue(depth)
        self._history = history
        self._counters = counters
        self._returned_ns = 0

    def declare(self, session: zenoh.Session, post: Post, submit: Post) -> Any:
        """Declare the subscriber; see ``Bus`` for the two ways to pass a call on."""

        def queue(sample: zenoh.Sample) -> None:
            now_ns = clock.now_ns()
            if self._items.add((sample, now_ns)):
                self._counters["overrun"] += 1
            elif now_ns - self._returned_ns < WAITED_NS:
                # In a flood this thread only stamps: samples that waited would look fresh.
                post(self._drain)
            else:
                submit(self._drain)
            self._returned_ns = clock.now_ns()

        if not self._history:
            return session.declare_subscriber(self._key, queue)
        return zenoh.ext.declare_advanced_subscriber(
            session,
            self._key,
            queue,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )

    def _drain(self) -> None:
        if item := self._items.take():
            self._take(*item)
