"""A bridge in an endless loop, as a real-time process on the only CPU core."""

import subprocess
import sys

import pytest

from common.wire.commands import MotionKind
from tests.common.rights import needs_right
from verification.harness.fake_board import board
from verification.harness.waiting import wait_until

SPIN = """
import os
from common import realtime
from services.bridge.guard import DESCRIPTORS_ENV
realtime.request(realtime.BRIDGE)
realtime.limit()
os.write(int(os.environ[DESCRIPTORS_ENV].split(",")[-1]), b"\\0")
while True:
    pass
"""
GUARD = f"""
import os, sys
os.sched_setaffinity(0, {{min(os.sched_getaffinity(0))}})
from common import log, realtime
from common.config import Sources, load
from services.bridge.config import BridgeConfig
from services.bridge.guard import Guard
from services.bridge.udp import Sockets
config = load(BridgeConfig, Sources(environ={{}}, sets=sys.argv[1:])).config
log.configure(config.log, "guard")
realtime.request(realtime.GUARD, alone=True)
sys.exit(Guard(config, Sockets(config.board), [sys.executable, "-c", {SPIN!r}]).run())
"""


@needs_right
@pytest.mark.timed  # it takes a whole core
def test_a_bridge_that_runs_away_is_braked_for_and_killed() -> None:
    with board() as made:
        sets = [f"board.port={made.address[1]}", f"board.listen_ports={made.ports}"]
        command = [sys.executable, "-c", GUARD, *sets]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as guard:
            try:
                assert guard.stderr is not None
                said = guard.stderr.readline()
                count = len(made.motions)
                wait_until(lambda: len(made.motions) > count, "BRAKE")
            finally:
                guard.terminate()
    # A guard that had to wait would have found that Linux had ended it, after a second.
    assert "the bridge hangs: killed" in said
    assert {motion.kind for motion in made.motions} == {MotionKind.BREAK}
