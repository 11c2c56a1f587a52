"""Operator calls to the board: emergency brakes and lamps. Pure.

Both are answered with the board's echo, or with the reason for its absence. The switches call must
also echo safety's heartbeat, so that a delayed call is refused.
"""

from typing import Any

from msgspec import Struct

from common import messages as m
from common.freshness import NS_PER_S
from common.operator import Echoes
from common.wire.commands import LedSet
from services.bridge.output import Output
from services.bridge.readiness import Readiness


class Waiting(Struct, frozen=True):
    """A pending call that waits for the board's echo."""

    caller: Any
    until_ns: int


class Operator:
    """Answers ``srv/bridge/switches`` and ``srv/bridge/led``; one call of each at a time."""

    def __init__(self, readiness: Readiness, timeout_s: float) -> None:
        """Set up with the timeout of the board's echo, in seconds."""
        self._readiness = readiness
        self._timeout_s = timeout_s
        self._lamp: Waiting | None = None
        self._switching: Waiting | None = None
        self._echoes = Echoes()

    def on_safety(self, state: m.SafetyState, received_ns: int) -> None:
        """Process a safety state with its heartbeat."""
        self._echoes = self._echoes.received(state, received_ns)

    def on_switches(
        self, request: m.SwitchesRequest, caller: Any, now_ns: int, out: Output
    ) -> None:
        """Request the board's brakes; its echo answers the caller."""
        late = self._echoes.refusal(request.echo, now_ns)
        reason = late or self._refusal(self._switching, "switches")
        if reason:
            out.refuse(caller, reason)
            return
        self._readiness.want(request.ultrasonic_brake, request.bumper_brake, now_ns)
        self._switching = self._waiting(caller, now_ns)

    def on_led(self, request: m.LedRequest, caller: Any, now_ns: int, out: Output) -> LedSet | None:
        """Return the frame that sets a lamp channel; the echo answers the caller."""
        reason = self._refusal(self._lamp, "lamps")
        if reason:
            out.refuse(caller, reason)
            return None
        self._lamp = self._waiting(caller, now_ns)
        return LedSet(**{name: getattr(request, name) for name in request.__struct_fields__})

    def on_led_echo(self, done: bool, out: Output) -> None:
        """Process the board's answer to a lamp command."""
        if self._lamp is None:
            return
        if done:
            out.reply(self._lamp.caller, m.Done(text="the lamp is set"))
        else:
            out.refuse(self._lamp.caller, "the board reports a failure (0xAA)")
        self._lamp = None

    def on_tick(self, now_ns: int, out: Output) -> None:
        """Answer the calls whose echo was received or is overdue."""
        if self._lamp is not None and now_ns > self._lamp.until_ns:
            out.refuse(self._lamp.caller, self._overdue())
            self._lamp = None
        if self._switching is None:
            return
        if self._readiness.switches.settled:
            out.reply(self._switching.caller, self._readiness.message())
            self._switching = None
        elif now_ns > self._switching.until_ns:
            out.refuse(self._switching.caller, self._overdue())
            self._switching = None

    def _waiting(self, caller: Any, now_ns: int) -> Waiting:
        return Waiting(caller, now_ns + round(self._timeout_s * NS_PER_S))

    def _refusal(self, busy: Waiting | None, what: str) -> str:
        if self._readiness.link.state != "up":
            return f"the board is absent (link {self._readiness.link.state})"
        return f"another call for the {what} is pending" if busy else ""

    def _overdue(self) -> str:
        return f"the board did not echo within {self._timeout_s:g} s"
