"""A safety that answers resets as configured, at a contact."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field

from common import clock
from common.bus.bus import Bus, Caller
from common.loop import Loop
from t2 import keys
from t2.messages import (
    Cause,
    Direction,
    Phrase,
    Release,
    ResetDone,
    ResetRequest,
)
from tests.dashboard.bus_fixture import Peer
from verification.harness.bus import bus_on, running

HIT = (Phrase("contact"),)
CONTACT = Cause(
    name="contact", action="brake", age=1.0, text="The bumper was hit.", phrases=HIT, id=11
)
NEWER = Cause(
    name="contact", action="brake", age=0.1, text="The bumper was hit.", phrases=HIT, id=12
)
FREE = Release(believed_free="backward", travelled=0.4, age=2.0, forbidden=(), left=0.15)


@dataclass
class CallServers:
    """The received resets and the configured answers."""

    peer: Peer
    resets: list[ResetRequest] = field(default_factory=list)
    boot: int = 0
    is_effective: bool = True

    def declare(self, bus: Bus) -> None:
        bus.serve(keys.RESET, self.reset)

    def releases(self) -> set[Direction]:
        """Return the releases that the dashboard has requested."""
        return {drive.release for drive in self.peer.requests if drive.release != "none"}

    def reset(self, request: ResetRequest, caller: Caller[ResetDone]) -> None:
        self.resets.append(request)
        if self.is_effective:
            self.peer.latched, self.peer.causes = (), ()
        done = ResetDone(
            text="Reset.", boot=self.boot, heartbeat=clock.now_ns(), cleared=request.causes
        )
        caller.reply(done)


@contextlib.contextmanager
def serving(endpoint: str, peer: Peer) -> Iterator[CallServers]:
    """Answer while the context lasts, on the bus of a robot with a contact."""
    it = CallServers(peer, boot=peer.boot)
    peer.safe = True
    peer.latched, peer.causes, peer.release = ("contact",), (CONTACT,), FREE
    peer.requests.clear()
    with running(Loop()) as loop, bus_on(endpoint, loop, it.declare):
        yield it
    peer.latched, peer.causes, peer.release, peer.release_refusal = (), (), None, ""
