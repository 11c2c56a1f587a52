"""A source of drive requests: the publisher that every driving program uses."""

from collections.abc import Callable

from common import codec, keys
from common.bus.bus import Arrival, Bus
from common.messages import Direction, Drive, SafetyState
from common.operator import ReleaseCalls

DENIED_AFTER = 10  # requests; a router needs a moment to announce its subscribers
RELEASE_TIMEOUT_S = 0.3
HELD = "held"  # the first answer of a release, with any distance left


class DriveSource:
    """Publisher of drive requests under a source's name, with the echo of safety's heartbeat.

    The echo bounds the age of a request without synchronized clocks. No method blocks: without a
    bus a request is dropped. A router whose access rules forbid driving drops requests without an
    error, and does not announce safety's subscription either.
    """

    def __init__(self, bus: Bus, source: str, on_denied: Callable[[], None] = lambda: None) -> None:
        self.name = source
        self._publisher = bus.publisher(keys.DRIVE, source=source)
        self._echo = 0  # before the first state of safety; safety refuses 0
        self._dropped = 0  # requests in a row
        self._on_denied = on_denied
        bus.subscribe(keys.SAFETY, self._on_safety)

    def request(self, linear: float, angular: float) -> Drive:
        """Request a motion (m/s, rad/s, in ``base_link``) until the source's lease expires."""
        if not codec.finite(linear, angular):
            raise ValueError(f"non-finite request: {linear} m/s, {angular} rad/s")
        was_denied = self.denied
        self._dropped = self._dropped + 1 if self._publisher.passed_on is False else 0
        sent = self._publisher.put(Drive(linear=linear, angular=angular, echo=self._echo))
        if self.denied and not was_denied:
            self._on_denied()
        return sent

    @property
    def denied(self) -> bool:
        """Whether safety's state arrives but our requests do not: watching only."""
        return self._echo != 0 and self._dropped >= DENIED_AFTER

    def _on_safety(self, arrival: Arrival[SafetyState]) -> None:
        self._echo = arrival.message.heartbeat


def call_release(
    bus: Bus,
    calls: ReleaseCalls,
    direction: Direction | None,
    seen: SafetyState | None,
    newest: SafetyState | None,
    *,
    report: Callable[[bool, str], None],
) -> None:
    """Make the calls of one tick of a release, see ``ReleaseCalls.tick``.

    ``report`` receives whether the release is held, and the text: once, and for each new refusal.
    """

    def answered(is_held: bool, text: str) -> None:
        calls.answered()
        if calls.is_new(HELD if is_held else text):
            report(is_held, text)

    for request in calls.tick(direction, seen, newest):
        bus.call(
            keys.RELEASE,
            request,
            (lambda done: answered(True, done.text)) if request.held else lambda _: None,
            (lambda reason: answered(False, reason)) if request.held else lambda _: None,
            timeout_s=RELEASE_TIMEOUT_S,
        )
