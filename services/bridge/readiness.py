"""Whether the board may be driven: it is there, and both its emergency brakes are on.

Each return of the board asks for the brakes anew; configuration is replayed, motion never is.
"""

from common import keys
from common import messages as m
from common.freshness import S
from common.service import Node
from common.wire.frame import Frame
from services.bridge import link as links
from services.bridge import switches as brakes
from services.bridge.config import BridgeConfig


class Readiness:
    """Keeps link and switches, and tells of their transitions."""

    def __init__(self, node: Node[BridgeConfig]) -> None:
        self.link = links.Link()
        self.switches = brakes.Switches()
        self.epoch = 0
        self._node = node
        self._publisher = node.bus.publisher(keys.SWITCHES)
        self._silence_ns = round(node.config.bridge.silence * S)
        self._failover_ns = round(node.config.bridge.failover * S)
        self._echo_ns = round(node.config.bridge.echo_timeout * S)
        self._inhibited = False
        node.loop.every(1.0, lambda _: self.publish())

    @property
    def ready(self) -> bool:
        """Whether a RUN may reach the board."""
        return self.link.state == "up" and self.switches.verified

    def waiting(self) -> str:
        """Say in words what is missing; empty when ready."""
        if self.link.state != "up":
            return "the board has never been heard" if self.link.state == "never" else "link lost"
        if not self.switches.verified:
            return "the board's emergency brakes are not both on and echoed"
        return ""

    def believes(self, port: int, now_ns: int) -> bool:
        """Tell whether a datagram on this port counts."""
        return links.believes(self.link, port, now_ns, self._failover_ns)

    def on_frame(self, port: int, now_ns: int) -> None:
        """Take in a valid frame from the board."""
        before = self.link
        self.link = links.on_frame(before, port, now_ns)
        if before.state != "up":
            self.switches = brakes.on_return(now_ns)
            self._node.event("link_up", "info", "the board is there", before=before.state)
        elif before.active != port:
            number = self._node.config.board.listen_ports[port]
            self._node.event("port_changed", "warning", f"port {number} took over", port=number)

    def on_restart(self, now_ns: int) -> None:
        """The board's counters have started anew."""
        self.epoch += 1
        self.switches = brakes.on_return(now_ns)
        self._node.event(
            "board_restarted", "warning", "the board has started anew", epoch=self.epoch
        )

    def on_echo(self, ultrasonic: bool | None, bumper: bool | None) -> None:
        """Take in the echo of one switch."""
        before = self.switches
        self.switches = brakes.on_echo(before, ultrasonic, bumper)
        if self.switches != before:
            self.publish()

    def want(self, ultrasonic: bool | None, bumper: bool | None, now_ns: int) -> None:
        """Want other positions, on an operator's request."""
        self.switches = brakes.on_request(self.switches, ultrasonic, bumper, now_ns)

    def on_tick(self, now_ns: int) -> list[Frame]:
        """Notice what is overdue; return the frames that ask for the switches."""
        before = self.link
        self.link = links.on_tick(before, now_ns, self._silence_ns)
        if self.link.state != before.state:
            self._node.event("link_lost", "error", "the board is silent")
        if self.link.state != "up":
            return []
        self.switches, frames = brakes.on_tick(self.switches, now_ns)
        self._tell_inhibited(now_ns)
        return frames

    def publish(self) -> None:
        """Publish the switches as the board echoed them."""
        self._publisher.put(self.message())

    def message(self) -> m.Switches:
        """Return the switches as the board echoed them."""
        return m.Switches(
            ultrasonic_brake=self.switches.ultrasonic, bumper_brake=self.switches.bumper
        )

    def _tell_inhibited(self, now_ns: int) -> None:
        overdue = now_ns - self.switches.since_ns > self._echo_ns
        inhibited = overdue and not self.switches.verified
        if inhibited and not self._inhibited:
            text = "no motion: the board's emergency brakes are not both on and echoed"
            self._node.event("switches_unverified", "error", text)
        self._inhibited = inhibited
