"""What the inspecting tools hold to the bus: a session that takes any key, right or wrong.

A service lets its loop be called; a tool asks and waits in its own thread, and ctrl-c reaches it
there. Zenoh's threads only note when a sample came and queue it.
"""

import queue
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import zenoh
import zenoh.ext

from common.bus.calls import is_timeout
from common.bus.publisher import QUERY_CONGESTION, qos
from common.bus.sample import copied
from common.bus.session import check_files, client_config
from common.errors import LinkError
from common.keys import ClassOfService
from common.sample import Sample
from common.settings import BusSettings

MATCH_S = 1.0  # until the router has told who is there for what was declared
MOST = 20_000  # samples that may wait for a slow reader; the newest of more are left out
PAUSE_S = 0.02


@dataclass(frozen=True, slots=True)
class Answer:
    """What came back for a query; ``refusal`` says why it was refused."""

    key: str
    payload: bytes
    encoding: str = ""
    refusal: str = ""


class Probe:
    """One session of one tool."""

    def __init__(self, session: zenoh.Session) -> None:
        self.zid = str(session.zid())
        self.left_out = 0
        self._session = session
        self._samples: queue.SimpleQueue[Sample] = queue.SimpleQueue()
        self._declared: list[Any] = []  # references keep them alive

    def listen(self, expression: str, *, history: bool = False) -> None:
        """Hear what is put on these keys; with ``history`` also what publishers have kept."""
        if history:
            kept = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            made: Any = zenoh.ext.declare_advanced_subscriber(
                self._session, expression, self._queue, history=kept
            )
        else:
            made = self._session.declare_subscriber(expression, self._queue)
        self._declared.append(made)

    def take(self, wait_s: float) -> Sample | None:
        """Return the oldest sample that waits; None when none comes for so long."""
        try:
            return self._samples.get(timeout=max(0.0, wait_s))
        except queue.Empty:
            return None

    def samples(self, seconds: float | None = None) -> Iterator[Sample]:
        """Yield what comes, for so long or for good."""
        end_s = time.monotonic() + (float("inf") if seconds is None else seconds)
        while (left_s := end_s - time.monotonic()) > 0:
            heard = self.take(min(left_s, 1.0))
            if heard:
                yield heard

    def put(
        self,
        key: str,
        payload: bytes,
        encoding: str,
        service: ClassOfService,
        raw: bytes | None = None,
    ) -> None:
        """Publish once, ``raw`` beside the payload."""
        self._session.put(key, payload, encoding=encoding, attachment=raw, **qos(service))

    def ask(
        self, selector: str, payload: bytes | None = None, timeout_s: float = 2.0
    ) -> list[Answer]:
        """Return every answer to a query; none when nobody answers in time."""
        replies = self._session.get(
            selector, payload=payload, timeout=timeout_s, congestion_control=QUERY_CONGESTION
        )
        return [_answer(reply) for reply in replies if not is_timeout(reply)]

    def alive(self, expression: str, timeout_s: float = 2.0) -> list[str]:
        """Return the liveliness tokens that stand."""
        replies = self._session.liveliness().get(expression, timeout=timeout_s)
        return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok)

    def has_reader(self, key: str) -> bool:
        """Tell whether the router would pass what is put there to anybody else; puts nothing."""
        elsewhere = zenoh.Locality.REMOTE  # what this very session listens to does not count
        return self._matched(self._session.declare_publisher(key, allowed_destination=elsewhere))

    def has_server(self, key: str) -> bool:
        """Tell whether the router would pass a query to anybody; asks nothing."""
        return self._matched(self._session.declare_querier(key))

    def _matched(self, declared: Any) -> bool:
        end_s = time.monotonic() + MATCH_S
        try:
            while not declared.matching_status.matching:
                if time.monotonic() > end_s:
                    return False
                time.sleep(PAUSE_S)
            return True
        finally:
            declared.undeclare()

    def _queue(self, sample: zenoh.Sample) -> None:
        received_ns, wall_ns = time.monotonic_ns(), time.time_ns()
        if self._samples.qsize() >= MOST:
            self.left_out += 1
            return
        self._samples.put(copied(sample, received_ns, wall_ns))


@contextmanager
def probe(where: BusSettings) -> Iterator[Probe]:
    """Join the bus while the context lasts; raise ``LinkError`` when no router answers."""
    check_files(where, where.endpoints)
    with _opened(where) as session:
        yield Probe(session)


def _opened(where: BusSettings) -> zenoh.Session:
    for turn in range(len(where.endpoints)):
        with suppress(zenoh.ZError):
            return zenoh.open(client_config(where, turn))
    raise LinkError(
        f"no router answers at {', '.join(where.endpoints)}: is `t2 up` on there? "
        "`t2 doctor` looks further; --set bus.connect=tcp/HOST:7447 looks elsewhere"
    )


def valid(expression: str) -> bool:
    """Tell whether it is a key or key expression as Zenoh wants it."""
    try:
        zenoh.KeyExpr(expression)
    except zenoh.ZError:
        return False
    return True


def intersects(one: str, other: str) -> bool:
    """Tell whether some key is in both expressions."""
    return bool(zenoh.KeyExpr(one).intersects(zenoh.KeyExpr(other)))


def includes(wide: str, narrow: str) -> bool:
    """Tell whether every key of the second expression is in the first."""
    return bool(zenoh.KeyExpr(wide).includes(zenoh.KeyExpr(narrow)))


def _answer(reply: zenoh.Reply) -> Answer:
    if reply.ok is not None:
        sample = reply.ok
        return Answer(str(sample.key_expr), sample.payload.to_bytes(), str(sample.encoding))
    payload = reply.err.payload.to_bytes() if reply.err else b""
    return Answer("", b"", refusal=payload.decode(errors="replace") or "refused without a reason")
