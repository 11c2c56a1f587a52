"""The relay between PC and board, by its reports. Pure.

It reports from its own UDP port, ``board.relay_port``, which the board cannot use. With that
setting the bridge obeys no RUN while the relay is silent or brakes: a protection that is configured
must be there, and the STOP that the bridge sends meanwhile is the neutral command that ends the
relay's BRAKE.
"""

from typing import Annotated

import msgspec

from common.freshness import NS_PER_S
from services.bridge.core.output import Event, Outputs
from t2 import messages as m
from t2.messages import Few, Name, Phrase, Phrases

RELAY_SILENCE_NS = NS_PER_S // 2  # five reports


class RelayReport(msgspec.Struct, frozen=True):
    """A report, as ``services/relay`` sends it in JSON."""

    version: Name
    braking: Name
    uptime: float
    counters: Annotated[dict[Name, Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]], Few]


class RelayStatus:
    """The newest report, and the transitions of the relay."""

    def __init__(self, required: bool) -> None:
        """Set up; without a configured relay all reports are ignored."""
        self.waiting: Phrases = (Phrase("relay.never"),) if required else ()
        self._required = required
        self._state: m.LinkState = "never"
        self._report = RelayReport("", "", 0.0, {})
        self._received_ns = 0
        self._event = ""  # the newest one

    def take(self, datagram: bytes, now_ns: int) -> bool:
        """Process a report; return whether it is valid."""
        try:
            self._report = msgspec.json.decode(datagram, type=RelayReport)
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
            return False
        self._state, self._received_ns = "up", now_ns
        return True

    def on_tick(self, now_ns: int) -> Outputs:
        """Detect a silent relay, and report transitions."""
        if not self._required or self._state == "never":
            return
        if now_ns - self._received_ns > RELAY_SILENCE_NS:
            self._state, self.waiting = "lost", (Phrase("relay.lost"),)
            event = Event("relay_lost", "error")
        elif self._report.braking:
            reason = self._report.braking
            self.waiting = (Phrase("relay.brakes", {"reason": f"relay_{reason}"}),)
            event = Event("relay_braking", "warning", {"reason": reason}, self.waiting)
        else:
            self.waiting = ()
            event = Event("relay_up", "info")
        if event.name != self._event:
            self._event = event.name
            yield event

    def message(self) -> m.Relay | None:
        """Return state and newest report for the link message; None without a configured relay."""
        if not self._required:
            return None
        report = self._report
        return m.Relay(
            state=self._state, version=report.version, braking=report.braking,
            uptime=report.uptime, counters=report.counters,
        )  # fmt: skip
