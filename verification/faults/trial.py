"""One trial of a fault: the commands at the board, and what it takes to drive again."""

import random
import time
from collections.abc import Sequence

from common import clock
from common.freshness import NS_PER_S
from sim.trace import Command
from verification.faults.fault import Fault, Outcome, Sample
from verification.faults.stack_fixture import SPEED_MPS, StackFixture
from verification.harness.trace import first_stop_s, last_move_s, moves
from verification.harness.waiting import becomes_true

# After the fault, with motion still requested: the vehicle may only drive on by itself.
HOLD_ON_S = 0.7
REARM_S = 2.5
LATCHED_S = 0.3


def unrequested(commands: Sequence[Command]) -> bool:
    """Return whether any command moves the vehicle in a way that no driver requested."""
    return any(
        moves(c) and not (0.0 <= c.linear <= SPEED_MPS + 0.01 and c.angular == 0.0)
        for c in commands
    )


def run_trial(fixture: StackFixture, fault: Fault) -> Sample:
    """Bring the vehicle to speed, inject the fault, restore, and observe."""
    fixture.ready()
    time.sleep(random.random() * 0.06)  # at a random phase of the requests
    fixture.death_s = 0.0
    called_ns = clock.now_ns()
    fault_ns = fault.inject(fixture) or called_ns
    time.sleep(max(0.0, fault.hold_s - (clock.now_ns() - fault_ns) / NS_PER_S))
    fixture.frames.follow()
    commands = list(fixture.frames.commands)
    moving = fixture.moving()
    ended = fixture.ended() if fault.harmless else ()
    fixture.restore()
    stopped_s = first_stop_s(commands, fault_ns, fault.stops)
    outcome = "drives on" if moving and stopped_s is None else _outcome(fixture)
    return Sample(
        stopped_s,
        last_move_s(commands, fault_ns),
        outcome,
        fault_ns,
        unrequested(fixture.frames.commands),
        ended,
        fixture.death_s,
    )


def _outcome(fixture: StackFixture) -> Outcome | None:
    if becomes_true(lambda: fixture.restart_ended().moving(), HOLD_ON_S):
        return "by itself"
    if fixture.rearm(LATCHED_S if fixture.client.latched else REARM_S):
        return "after a neutral"
    needs_reset = False
    for _ in range(10):
        fixture.restart_ended().request(0.0)
        time.sleep(0.1)
        # The campaign's repeated faults latch "flapping".
        needs_reset = needs_reset or fixture.client.latched not in ([], ["flapping"])
        fixture.reset()
        if fixture.rearm(REARM_S):
            return "after a reset" if needs_reset else "after a neutral"
    return None
