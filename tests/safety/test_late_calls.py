"""Operator's calls that arrive late, at the real process over a real router."""

import time

from common import keys
from common.bus.bus import Arrival
from common.loop import Loop
from common.messages import Motion
from tests.safety.peers import PATIENT, Peers, safety_process
from verification.harness.bus import bus_on, running
from verification.harness.waiting import wait_until

# Only how old inputs may be is patient; how old a call may be is as shipped.
SETS = {name: age for name, age in PATIENT.items() if name != "max_echo_age"}


class Operator(Peers):
    """Plays the bridge, too, and remembers every motion that moves."""

    def __init__(self, loop: Loop) -> None:
        super().__init__(loop)
        self.runs = 0

    def on_motion(self, arrival: Arrival[Motion]) -> None:
        super().on_motion(arrival)
        self.runs += arrival.message.command == "run" and arrival.message.linear != 0

    def shows(self, *latched: str) -> bool:
        """Return whether exactly this is latched."""
        return self.state is not None and self.state.latched == latched

    def touch(self, *, pressed: bool) -> None:
        """Press the bumper or free it, and wait until safety has seen three samples of that."""
        self.pressed = pressed
        assert self.bumper is not None
        sent = self.bumper.next_seq + 4
        wait_until(lambda: self.bumper and self.bumper.next_seq > sent, "samples")
        wait_until(lambda: self.motion and self.motion.judged >= sent, "their judgement")


def wait(seconds: float) -> None:
    """Wait unconditionally."""
    end_s = time.monotonic() + seconds
    wait_until(lambda: time.monotonic() > end_s, "a while")


def test_a_late_reset_clears_nothing(endpoint: str) -> None:
    loop = Loop()
    peers = Operator(loop)
    with (
        running(loop),
        bus_on(endpoint, loop, peers.declare),
        safety_process(endpoint, SETS),
    ):
        peers.until("stop", "stop")
        peers.touch(pressed=True)
        peers.touch(pressed=False)
        old = peers.reset()
        wait(1.0)
        assert "allowed is 1 s" in peers.call(keys.RESET, old)
        wait_until(lambda: peers.call(keys.RESET, peers.reset()) == "done", "a reset in time")
        wait_until(lambda: peers.shows(), "nothing latched")
        peers.touch(pressed=True)
        wait_until(lambda: peers.shows("contact"), "a newer contact")
        peers.touch(pressed=False)
        newer = peers.reset()
        assert "no longer latched" in peers.call(
            keys.RESET, type(old)(echo=newer.echo, causes=old.causes)
        )
        assert peers.shows("contact")
        assert peers.runs == 0
