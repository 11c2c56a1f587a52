"""The board's two emergency brakes: requested, sent, and confirmed by the board. Pure.

After each return of the board both are requested again, whatever an operator had set before: a
board that restarted has lost them.

=================== ============================================================================
a brake is          it is sent
=================== ============================================================================
not confirmed as    every 0.1 s; after the timeout the bridge counts as inhibited
wanted
confirmed           every 0.2 s, because the wire has no query for it; without a confirmation of
                    five consecutive sends it is no longer known to be on
behind a gap of     at once: a board that restarted with its counters near zero shows nothing
60 ms in all frames else, and its emergency brakes are off
=================== ============================================================================

A firmware that confirms nothing cannot verify them. Where the settings accept that, the board may
be driven as long as both are commanded on and none was confirmed as off.
"""

from collections.abc import Callable

from common.freshness import NS_PER_S
from common.wire.frame import Frame

# Half a tick less than 0.1 and 0.2 s: the tick that is due may come early.
ASK_NS = NS_PER_S * 9 // 100
AGAIN_NS = NS_PER_S * 19 // 100
UNCONFIRMED = 5  # consecutive sends (1 s) for which an earlier confirmation counts


class Brake:
    """One emergency brake of the board: the position wanted, and the one confirmed."""

    def __init__(self, command: Callable[[bool], Frame]) -> None:
        """Set up with the frame that sets it."""
        self._command = command
        self.on_return(0)

    def on_return(self, now_ns: int) -> None:
        """Process the return or the restart of the board: it is wanted on."""
        self.want(True, now_ns)

    def want(self, on: bool, now_ns: int) -> None:
        """Request a position; it takes effect with the confirmation."""
        self.wanted = on
        self.since_ns = now_ns
        self._confirmed: bool | None = None
        self._unconfirmed = 0  # sends since the last confirmation
        self.send_at_once()

    def send_at_once(self) -> None:
        """Make it due."""
        self._sent_ns: int | None = None

    def on_confirmation(self, on: bool) -> None:
        """Process the board's confirmation."""
        self._confirmed, self._unconfirmed = on, 0

    @property
    def position(self) -> bool | None:
        """The last confirmed one; an "on" counts for five sends, an "off" until an "on"."""
        is_old = self._unconfirmed > UNCONFIRMED
        return None if self._confirmed and is_old else self._confirmed

    @property
    def settled(self) -> bool:
        """Whether the board has confirmed the requested position."""
        return self.position is self.wanted

    @property
    def assumed_on(self) -> bool:
        """Whether it is commanded on, and the board has confirmed no "off"."""
        return self.wanted and self.position is not False

    def due(self, now_ns: int) -> Frame | None:
        """Return its frame if it is due."""
        wait_ns = AGAIN_NS if self.settled else ASK_NS
        if self._sent_ns is not None and now_ns - self._sent_ns < wait_ns:
            return None
        self._sent_ns = now_ns
        self._unconfirmed += 1
        return self._command(self.wanted)
