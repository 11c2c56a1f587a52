"""Bus access of the inspecting tools: a session that takes any key and any payload.

A tool asks and waits in its own thread, where ctrl-c reaches it. Zenoh's threads only timestamp and
queue samples.
"""

import queue
import time
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import zenoh
import zenoh.ext

from common import clock
from common.bus.bus import copied, is_timeout
from common.bus.publisher import QUERY_CONGESTION, qos
from common.bus.session import check_files, client_config
from common.cli_args import hint
from common.settings import BusSettings
from t2 import codec
from t2.codec import Sample
from t2.errors import LinkError
from t2.keys import ClassOfService
from t2.messages import Refusal

MATCH_TIMEOUT_S = 1.0  # until the router has reported matching declarations
QUEUE_MAX = 20_000  # samples queued for a slow reader; the oldest ones are dropped
POLL_PERIOD_S = 0.02


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer to a query, or its ``refusal``."""

    key: str
    payload: bytes
    encoding: str = ""
    refusal: Refusal | None = None


class Inspector:
    """Session of one tool."""

    def __init__(self, session: zenoh.Session, words: Sequence[str] = ()) -> None:
        """``words`` are the options of the tool, which the command in an error repeats."""
        self.zid = str(session.zid())
        self.doctor = hint("doctor", words)
        self.left_out = 0  # samples dropped from the full queue
        self._session = session
        self._samples: queue.SimpleQueue[Sample] = queue.SimpleQueue()
        self._declared: list[Any] = []  # references keep them alive

    def listen(self, expression: str, *, history: bool = False) -> None:
        """Subscribe to these keys; with ``history`` also to samples that publishers kept."""
        self._declared.append(
            zenoh.ext.declare_advanced_subscriber(
                self._session, expression, self._queue,
                history=zenoh.ext.HistoryConfig(detect_late_publishers=True),
            )
            if history
            else self._session.declare_subscriber(expression, self._queue)
        )  # fmt: skip

    def take(self, wait_s: float) -> Sample | None:
        """Return the oldest queued sample; None after ``wait_s``."""
        try:
            return self._samples.get(timeout=max(0.0, wait_s))
        except queue.Empty:
            return None

    def queued(self) -> Iterator[Sample]:
        """Yield the samples that are queued now, without those that arrive meanwhile."""
        for _ in range(self._samples.qsize()):
            if sample := self.take(0.0):
                yield sample

    def discard(self) -> None:
        """Drop the samples that are queued now: what is taken next was received after this."""
        for _ in self.queued():
            pass

    def samples(self, seconds: float | None = None) -> Iterator[Sample]:
        """Yield samples, for ``seconds`` or without end."""
        end_s = time.monotonic() + (float("inf") if seconds is None else seconds)
        while (left_s := end_s - time.monotonic()) > 0:
            if sample := self.take(min(left_s, 1.0)):
                yield sample

    def put(
        self,
        key: str,
        payload: bytes,
        encoding: str,
        service: ClassOfService,
        raw: bytes | None = None,
    ) -> None:
        """Publish once, with ``raw`` as attachment."""
        self._session.put(key, payload, encoding=encoding, attachment=raw, **qos(service))

    def query(
        self, selector: str, payload: bytes | None = None, timeout_s: float = 2.0
    ) -> list[Answer]:
        """Return all answers to a query within the timeout."""
        replies = self._session.get(
            selector, payload=payload, timeout=timeout_s, congestion_control=QUERY_CONGESTION
        )
        return [_answer(reply) for reply in replies if not is_timeout(reply)]

    def alive(self, expression: str, timeout_s: float = 2.0) -> list[str]:
        """Return the current liveliness tokens; raise ``LinkError`` if the list is incomplete."""
        replies = list(self._session.liveliness().get(expression, timeout=timeout_s))
        time.sleep(POLL_PERIOD_S)  # a lost link ends the query before it leaves this list
        info = self._session.info
        if any(map(is_timeout, replies)) or not (*info.routers_zid(), *info.peers_zid()):
            raise LinkError(f"the router has not listed the services in time; run {self.doctor}")
        return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok)

    def has_reader(self, *of: str) -> bool:
        """Return whether another session subscribes to one of these keys; publishes nothing."""
        elsewhere = zenoh.Locality.REMOTE  # subscriptions of this session do not count
        return _undeclared(
            *(self._session.declare_publisher(key, allowed_destination=elsewhere) for key in of)
        )

    def readers(self, keys: Collection[str]) -> set[str]:
        """Return the keys to which another session subscribes, and that may be published here."""
        elsewhere = zenoh.Locality.REMOTE
        declared: dict[str, Any] = {
            key: self._session.declare_publisher(key, allowed_destination=elsewhere) for key in keys
        }
        _matches(*declared.values(), every=True)
        found = {key for key, each in declared.items() if each.matching_status.matching}
        for each in declared.values():
            each.undeclare()
        return found

    def has_server(self, key: str) -> bool:
        """Return whether a queryable matches the key; sends no query."""
        return _undeclared(self._session.declare_querier(key))

    def _queue(self, sample: zenoh.Sample) -> None:
        received_ns, wall_ns = clock.now_ns(), time.time_ns()
        if self._samples.qsize() >= QUEUE_MAX and self.take(0.0):
            self.left_out += 1
        self._samples.put(copied(sample, received_ns, wall_ns))


@contextmanager
def inspecting(where: BusSettings, words: Sequence[str] = ()) -> Iterator[Inspector]:
    """Connect to the bus for the context; raise ``LinkError`` when no router answers."""
    check_files(where, where.endpoints)
    for attempt in range(len(where.endpoints)):
        with suppress(zenoh.ZError):
            session = zenoh.open(client_config(where, attempt))
            break
    else:
        raise LinkError(
            f"no router answers at {', '.join(where.endpoints)}: is `t2 up` running there? "
            f"Run {hint('doctor', words)}, or choose another router: --set bus.connect="
            f"{'tls' if where.certificate else 'tcp'}/HOST:7447"
        )
    with session:
        yield Inspector(session, words)


def _matches(*declared: Any, every: bool = False) -> bool:
    """Return whether one is matched within ``MATCH_TIMEOUT_S``, or all of them."""
    end_s = time.monotonic() + MATCH_TIMEOUT_S
    enough = all if every else any
    while not enough(each.matching_status.matching for each in declared):
        if time.monotonic() > end_s:
            return False
        time.sleep(POLL_PERIOD_S)
    return True


def _undeclared(*declared: Any) -> bool:
    """Return whether one is matched in time, and undeclare all."""
    try:
        return _matches(*declared)
    finally:
        for each in declared:
            each.undeclare()


def valid(expression: str) -> bool:
    """Return whether it is a valid key expression."""
    try:
        zenoh.KeyExpr(expression)
    except zenoh.ZError:
        return False
    return True


def intersects(one: str, other: str) -> bool:
    """Return whether some key matches both expressions."""
    return bool(zenoh.KeyExpr(one).intersects(zenoh.KeyExpr(other)))


def _answer(reply: zenoh.Reply) -> Answer:
    if reply.ok is not None:
        sample = reply.ok
        return Answer(str(sample.key_expr), sample.payload.to_bytes(), str(sample.encoding))
    payload = reply.err.payload.to_bytes() if reply.err else b""
    return Answer("", b"", refusal=codec.refusal(payload))
