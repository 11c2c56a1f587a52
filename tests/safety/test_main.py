"""The real process, a real router, and a bridge and a driver made of publishers."""

import contextlib
import signal
import subprocess
import sys

from common import keys
from common.loop import Loop
from tests.safety.peers import Peers, StarvedError, safety_process
from verification.harness.bus import bus_on, running
from verification.harness.waiting import PATIENCE_S, wait_until


def test_from_inhibited_to_run_to_contact_to_reset(endpoint: str) -> None:
    for _ in range(3):
        with contextlib.suppress(StarvedError):
            scenario(endpoint)
            return
    raise AssertionError("the machine was too busy three times")


def scenario(endpoint: str) -> None:
    loop = Loop()
    peers = Peers(loop)
    with running(loop), bus_on(endpoint, loop, peers.declare), safety_process(endpoint) as process:
        peers.until("stop", "stop")  # settled; nobody asks
        peers.asking = 0.3
        peers.until("stop", "inhibited")  # not before a neutral request
        peers.asking = 0.0
        peers.until("run", "run")
        peers.asking = 0.3
        peers.until("run", "run", moving=True)

        peers.pressed = True
        peers.until("brake", "brake")
        assert peers.motion is not None
        assert peers.bumper is not None
        assert peers.bumper.last is not None
        assert peers.motion.judged_boot == peers.bumper.last.boot
        assert 0 < peers.motion.judged <= peers.bumper.last.seq
        peers.asking = None
        assert "Still present" in peers.call(keys.RESET, peers.reset())
        peers.pressed = False
        wait_until(
            lambda: peers.starved or peers.call(keys.RESET, peers.reset()) == "done",
            "a reset that is granted",
        )
        peers.until("stop", "stop")

        peers.bus.estop()
        peers.until("brake", "brake")
        peers.asking, peers.release = 0.0, "backward"
        wait_until(
            lambda: peers.state and "demo may not release" in peers.state.release_refusal,
            "the refusal",
        )
        wanted = {"contact", "reset", "reset_refused", "estop", "release_refused", "source"}
        wait_until(lambda: wanted <= set(peers.events), f"{wanted - set(peers.events)}")

        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0


def test_a_setting_that_takes_a_protection_away_ends_the_program() -> None:
    command = [sys.executable, "-m", "services.safety", "--set", "safety.margin=0"]
    done = subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 78
    assert b"margin" in done.stderr
    assert b"unsafe_overrides" in done.stderr
