"""Operator calls to the board: emergency brakes and lamps. Pure.

Both are answered with the board's confirmation, or with the reason for its absence. The call for
the brakes must also echo safety's heartbeat, so that a delayed call is refused.
"""

from collections.abc import Callable
from typing import Any

from msgspec import Struct
from msgspec.structs import asdict

from common.freshness import NS_PER_S
from common.heartbeat import Echoes
from common.wire.commands import LedSet
from common.wire.frame import Frame
from services.bridge.core.output import Outputs, Refuse, Reply, Send
from services.bridge.core.readiness import Readiness
from t2 import messages as m
from t2 import words
from t2.messages import Phrase


class Pending(Struct, frozen=True):
    """A call that waits for the board's confirmation."""

    caller: Any
    until_ns: int


class Calls:
    """The calls ``srv/bridge/switches`` and ``srv/bridge/led``; one of each at a time."""

    def __init__(
        self, readiness: Readiness, timeout_s: float, ask: Callable[[Frame, int], Send]
    ) -> None:
        """Set up with the timeout of the board's confirmation (s), and what sends it a frame."""
        self._readiness = readiness
        self._timeout_s = timeout_s
        self._ask = ask
        self._pending: dict[str, Pending] = {}  # by what is called
        self._echoes = Echoes()

    def on_safety(self, state: m.SafetyState, received_ns: int) -> None:
        """Process a safety state with its heartbeat."""
        self._echoes = self._echoes.received(state, received_ns)

    def on_switches(self, request: m.SwitchesRequest, caller: Any, now_ns: int) -> Outputs:
        """Request positions of the board's brakes; their confirmation answers the caller."""
        late = self._echoes.refusal(request.echo, now_ns)
        if reason := late or self._refusal("switches"):
            yield Refuse(caller, reason)
            return
        self._begin("switches", caller, now_ns)
        for brake, on in (
            (self._readiness.ultrasonic, request.ultrasonic_brake),
            (self._readiness.bumper, request.bumper_brake),
        ):
            if on is not None:
                brake.want(on, now_ns)

    def on_led(self, request: m.LedRequest, caller: Any, now_ns: int) -> Outputs:
        """Set a lamp channel; the confirmation answers the caller."""
        if reason := self._refusal("lamps"):
            yield Refuse(caller, reason)
            return
        self._begin("lamps", caller, now_ns)
        yield self._ask(LedSet(**asdict(request)), now_ns)

    def on_led_answer(self, done: bool) -> Outputs:
        """Process the board's answer to a lamp command."""
        if call := self._pending.pop("lamps", None):
            if done:
                yield Reply(call.caller, words.done(Phrase("board.lamp_set")))
            else:
                yield Refuse(call.caller, (Phrase("board.failure"),))

    def on_tick(self, now_ns: int) -> Outputs:
        """Answer the calls that the board has confirmed, or not in time."""
        if "switches" in self._pending and self._readiness.settled:
            yield Reply(self._pending.pop("switches").caller, self._readiness.message())
        for what, call in list(self._pending.items()):
            if now_ns > call.until_ns:
                del self._pending[what]
                late = Phrase("board.unconfirmed", {"timeout": self._timeout_s})
                yield Refuse(call.caller, (late,))

    def _begin(self, what: str, caller: Any, now_ns: int) -> None:
        self._pending[what] = Pending(caller, now_ns + round(self._timeout_s * NS_PER_S))

    def _refusal(self, what: str) -> m.Phrases:
        if self._readiness.link != "up":
            return (Phrase("board.absent", {"link": self._readiness.link}),)
        return (Phrase("board.pending", {"what": what}),) if what in self._pending else ()
