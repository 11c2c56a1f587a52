"""Bumper samples at the real process: few cause a decision, and none of a burst seems lost."""

import time

import pytest

from common.bus.bus import Arrival
from common.loop import Loop
from common.messages import Bumper, Motion, SafetyState
from tests.safety.peers import Peers, safety_process
from verification.harness.bus import bus_on, running
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

BURST = 12  # free samples at once, as after a stall
LASTS_S = 2.0


class Watcher(Peers):
    """Remembers the texts of all causes, and counts the motions."""

    def __init__(self, loop: Loop) -> None:
        super().__init__(loop)
        self.texts: set[str] = set()
        self.motions = 0

    def on_state(self, arrival: Arrival[SafetyState]) -> None:
        super().on_state(arrival)
        self.texts |= {cause.text for cause in arrival.message.causes}

    def on_motion(self, arrival: Arrival[Motion]) -> None:
        super().on_motion(arrival)
        self.motions += 1


def test_no_sample_of_a_burst_seems_lost(endpoint: str) -> None:
    loop = Loop()
    peers = Watcher(loop)

    def burst(_: int) -> None:
        if peers.bumper is not None:
            for _ in range(BURST):
                peers.bumper.put(Bumper(pressed=False))

    with running(loop), bus_on(endpoint, loop, peers.declare), safety_process(endpoint):
        peers.until("stop", "stop")
        peers.texts.clear()
        loop.post(lambda: loop.every(0.05, burst))
        time.sleep(LASTS_S)
    assert "Samples of the bumper were lost." not in peers.texts


def test_repeated_samples_cause_no_decision(endpoint: str) -> None:
    """Ultrasonic and driver samples, 150 a second here, do; bumper samples would add 50."""
    loop = Loop()
    peers = Watcher(loop)
    with running(loop), bus_on(endpoint, loop, peers.declare), safety_process(endpoint):
        peers.until("stop", "stop")
        bumper = peers.bumper
        assert bumper is not None
        since, seq = peers.motions, bumper.next_seq
        time.sleep(LASTS_S)
        decisions, samples = peers.motions - since, bumper.next_seq - seq
        assert samples > 30
        assert decisions < 3.6 * samples
        seq = bumper.next_seq
        peers.pressed = True
        wait_until(lambda: peers.motion and peers.motion.judged > seq, "the hit, judged")
