"""What an operator may ask of the board: its emergency brakes and its lamps.

Both answer with the board's own echo, or with the reason why there is none.
"""

import time
from collections.abc import Callable

from msgspec import Struct

from common import keys
from common import messages as m
from common.bus.calls import Caller
from common.freshness import S
from common.service import Node
from common.wire.commands import LedSet
from common.wire.frame import Frame
from services.bridge.config import BridgeConfig
from services.bridge.readiness import Readiness


class Waiting(Struct, frozen=True):
    """A call whose echo is due."""

    caller: Caller[m.Done]
    until_ns: int


class Operator:
    """Serves ``srv/bridge/switches`` and ``srv/bridge/led``."""

    def __init__(
        self, node: Node[BridgeConfig], readiness: Readiness, send: Callable[[Frame], None]
    ) -> None:
        self._readiness = readiness
        self._send = send
        self._timeout_s = node.config.bridge.echo_timeout
        self._lamp: Waiting | None = None
        self._switching: tuple[Caller[m.Switches], int] | None = None
        node.bus.serve(keys.SET_SWITCHES, self.on_switches)
        node.bus.serve(keys.SET_LED, self.on_led)

    def on_switches(self, request: m.SwitchesRequest, caller: Caller[m.Switches]) -> None:
        """Ask the board to set its brakes; the echo answers the caller."""
        reason = self._refusal(self._switching is not None, "switches")
        if reason:
            caller.refuse(reason)
            return
        now_ns = time.monotonic_ns()
        self._readiness.want(request.ultrasonic_brake, request.bumper_brake, now_ns)
        self._switching = caller, now_ns + round(self._timeout_s * S)

    def on_led(self, request: m.LedRequest, caller: Caller[m.Done]) -> None:
        """Ask the board to set a lamp channel; the echo answers the caller."""
        reason = self._refusal(self._lamp is not None, "lamps")
        if reason:
            caller.refuse(reason)
            return
        self._send(LedSet(**{name: getattr(request, name) for name in request.__struct_fields__}))
        self._lamp = Waiting(caller, time.monotonic_ns() + round(self._timeout_s * S))

    def on_led_echo(self, done: bool) -> None:
        """Take in what the board says of the lamp."""
        if self._lamp is None:
            return
        if done:
            self._lamp.caller.reply(m.Done(text="the lamp is set"))
        else:
            self._lamp.caller.refuse("the board answers that it failed (0xAA)")
        self._lamp = None

    def on_tick(self, now_ns: int) -> None:
        """Answer the calls whose echo has come, or is overdue."""
        if self._lamp is not None and now_ns > self._lamp.until_ns:
            self._lamp.caller.refuse(self._overdue())
            self._lamp = None
        if self._switching is None:
            return
        caller, until_ns = self._switching
        if self._readiness.switches.settled:
            caller.reply(self._readiness.message())
            self._switching = None
        elif now_ns > until_ns:
            caller.refuse(self._overdue())
            self._switching = None

    def _refusal(self, busy: bool, what: str) -> str:
        if self._readiness.link.state != "up":
            return f"the board is absent (link {self._readiness.link.state})"
        return f"another call for the {what} is under way" if busy else ""

    def _overdue(self) -> str:
        return f"the board did not echo within {self._timeout_s:g} s"
