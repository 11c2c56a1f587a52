"""The relay between PC and board, by its own reports: whether it is there and passes RUN. Pure.

The reports come from the relay's own UDP port, ``board.relay_port``, which the board cannot use.
With that setting the bridge obeys no RUN while the relay is silent or brakes: a protection that is
configured must be there, and the STOP that the bridge sends meanwhile is the neutral command that
ends the relay's BRAKE.
"""

from typing import Annotated

import msgspec

from common import messages as m
from common.freshness import NS_PER_S
from common.verdict import Few, Name
from services.bridge.output import Output

SILENCE_NS = NS_PER_S // 2  # five reports


class Report(msgspec.Struct, frozen=True):
    """A report, as ``services/relay`` sends it in JSON."""

    version: Name
    braking: Name
    uptime: float
    counters: Annotated[dict[Name, Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]], Few]


class RelayStatus:
    """The newest report, and the transitions of the relay."""

    def __init__(self, required: bool) -> None:
        """Set up; without a configured relay all reports are ignored."""
        self.waiting = "nothing received from the relay yet" if required else ""
        self._required = required
        self._state: m.LinkState = "never"
        self._report = Report("", "", 0.0, {})
        self._received_ns = 0
        self._event = ""  # the newest one

    def take(self, datagram: bytes, now_ns: int) -> bool:
        """Process a report; return whether it is valid."""
        try:
            self._report = msgspec.json.decode(datagram, type=Report)
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
            return False
        self._state, self._received_ns = "up", now_ns
        return True

    def on_tick(self, now_ns: int, out: Output) -> None:
        """Detect a silent relay, and report transitions."""
        if not self._required or self._state == "never":
            return
        if now_ns - self._received_ns > SILENCE_NS:
            self._state, self.waiting = "lost", "the relay is silent"
            self._report_once("relay_lost", self.waiting, out)
        elif self._report.braking:
            self.waiting = f"the relay brakes: {self._report.braking}"
            self._report_once("relay_braking", self.waiting, out)
        else:
            self.waiting = ""
            self._report_once("relay_up", "the relay passes commands", out)

    def _report_once(self, name: str, text: str, out: Output) -> None:
        if name == self._event:
            return
        self._event = name
        if name == "relay_lost":
            out.event("relay_lost", "error", text)
        elif name == "relay_braking":
            out.event("relay_braking", "warning", text)
        else:
            out.event("relay_up", "info", text)

    def message(self) -> m.Relay | None:
        """Return state and newest report for the link message; None without a configured relay."""
        if not self._required:
            return None
        report = self._report
        return m.Relay(
            state=self._state, version=report.version, braking=report.braking,
            uptime=report.uptime, counters=report.counters,
        )  # fmt: skip
