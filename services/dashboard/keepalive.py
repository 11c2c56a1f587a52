"""The page that keeps the emergency stop alive: open, visible, and answering snapshots.

One page holds it. When that page is hidden, closed or cut off, nothing is sent for it any more, and
safety brakes and latches. Another page takes over only after that: a change that nobody notices
would hide that the first operator is gone.
"""

from dataclasses import dataclass

from common.freshness import NS_PER_S
from common.messages import SafetyState


@dataclass
class PageKeepalive:
    """The holder of one robot's emergency stop on this dashboard."""

    name: str  # in safety.estop_keepalive; empty: none
    holder: str | None = None  # a viewer
    _answered_ns: int = 0  # the holder's newest answer

    def answer(
        self, viewer: str, shown: SafetyState | None, newest: SafetyState | None, now_ns: int
    ) -> int | None:
        """Return the heartbeat to echo for a page's answer; None when it does not count.

        ``shown`` is the state that the page answers, ``newest`` the newest one.
        """
        known = newest.estop_keepalives if newest else ()
        ours = next((one for one in known if one.source == self.name), None)
        if ours is None or shown is None:
            return None
        is_held = ours.alive or now_ns - self._answered_ns <= ours.timeout * NS_PER_S
        if viewer != self.holder and is_held:
            return None
        self.holder, self._answered_ns = viewer, now_ns
        return shown.heartbeat

    def left(self, viewer: str) -> None:
        """Forget a page that is gone."""
        if self.holder == viewer:
            self.holder = None
