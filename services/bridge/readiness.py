"""Readiness of the board: connected, both its emergency brakes on, and the relay passing. Pure.

The link: ``never`` --frame--> ``up`` --silence--> ``lost`` --frame--> ``up``. On each return of the
board the brakes are requested again; configuration is replayed, motion never is.
"""

from msgspec import Struct
from msgspec.structs import replace

from common import messages as m
from common.freshness import NS_PER_S
from common.settings import Board
from common.wire.frame import Frame
from services.bridge import switches as brakes
from services.bridge.config import Bridge as Settings
from services.bridge.output import Output
from services.bridge.relay_status import RelayStatus


class Link(Struct, frozen=True):
    """Link state, by frames on either of our ports."""

    state: m.LinkState = "never"
    received_ns: int = 0
    up_ns: int = 0  # start of the current ``up`` phase


def link_on_frame(link: Link, now_ns: int) -> Link:
    """Process a valid frame."""
    up_ns = link.up_ns if link.state == "up" else now_ns
    return replace(link, state="up", received_ns=now_ns, up_ns=up_ns)


def link_on_tick(link: Link, now_ns: int, silence_ns: int) -> Link:
    """Detect a board that is silent for too long."""
    if link.state == "up" and now_ns - link.received_ns > silence_ns:
        return replace(link, state="lost")
    return link


class Readiness:
    """Tracks link and switches, and reports their transitions."""

    def __init__(self, settings: Settings, board: Board) -> None:
        self.link = Link()
        self.switches = brakes.Switches()
        self.relay = RelayStatus(board.relay_port > 0)
        self.epoch = 0
        self.gap_ns = 0  # end of the last short silence (no lost link) of the board
        self._ports = ", ".join(map(str, board.listen_ports))
        self._silence_ns = round(settings.silence * NS_PER_S)
        self._echo_ns = round(settings.echo_timeout * NS_PER_S)
        self._required = settings.require_switches
        self._inhibited = False

    @property
    def ready(self) -> bool:
        """Whether a RUN may reach the board."""
        return self.link.state == "up" and self._brakes_on and not self.relay.waiting

    @property
    def _brakes_on(self) -> bool:
        return self.switches.verified or (not self._required and self.switches.unechoed)

    def waiting(self) -> str:
        """Describe the missing condition; empty when ready."""
        if self.link.state == "never":
            return f"nothing received from the board yet on UDP port {self._ports}"
        if self.link.state != "up":
            return "link lost"
        if self.relay.waiting:
            return self.relay.waiting
        if not self._brakes_on:
            text = "the board's emergency brakes are not both on and echoed"
            if self._required and self._inhibited and self.switches.unechoed:
                text += "; a firmware without echoes needs bridge.require_switches = false"
            return text
        return ""

    def on_frame(self, now_ns: int, out: Output) -> None:
        """Process a valid frame from the board."""
        before = self.link
        self.link = link_on_frame(before, now_ns)
        if before.state != "up":
            self.switches = brakes.on_return(now_ns)
            out.event("link_up", "info", "the board is connected", before=before.state)
        elif now_ns - before.received_ns > brakes.GAP_NS:
            self.gap_ns = now_ns
            self.switches = brakes.on_gap(self.switches)

    def on_restart(self, now_ns: int, out: Output) -> None:
        """Process a restart of the board."""
        self.epoch += 1
        self.switches = brakes.on_return(now_ns)
        out.event("board_restarted", "warning", "the board has restarted", epoch=self.epoch)

    def on_echo(self, ultrasonic: bool | None, bumper: bool | None, out: Output) -> None:
        """Process the echo of one switch."""
        before = self.message()
        self.switches = brakes.on_echo(self.switches, ultrasonic, bumper)
        self._publish_change(before, out)

    def want(self, ultrasonic: bool | None, bumper: bool | None, now_ns: int) -> None:
        """Request other positions, for an operator."""
        self.switches = brakes.on_request(self.switches, ultrasonic, bumper, now_ns)

    def on_tick(self, now_ns: int, out: Output) -> list[Frame]:
        """Detect timeouts; return the frames that set the switches."""
        self.relay.on_tick(now_ns, out)
        before = self.link
        self.link = link_on_tick(before, now_ns, self._silence_ns)
        if self.link.state != before.state:
            out.event("link_lost", "error", "the board is silent")
        if self.link.state != "up":
            return []
        echoed = self.message()
        self.switches, frames = brakes.on_tick(self.switches, now_ns)
        self._publish_change(echoed, out)
        self._report_inhibited(now_ns, out)
        return frames

    def message(self) -> m.Switches:
        """Return the switches as the board echoed them."""
        return m.Switches(
            ultrasonic_brake=self.switches.ultrasonic, bumper_brake=self.switches.bumper
        )

    def _publish_change(self, before: m.Switches, out: Output) -> None:
        now = self.message()
        if now != before:
            out.publish("switches", now)

    def _report_inhibited(self, now_ns: int, out: Output) -> None:
        overdue = now_ns - self.switches.since_ns > self._echo_ns
        inhibited = overdue and not self._brakes_on
        if inhibited and not self._inhibited:
            text = "no motion: the board's emergency brakes are not both on and echoed"
            out.event("switches_unverified", "error", text)
        self._inhibited = inhibited
