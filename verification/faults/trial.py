"""One trial of a fault: the commands at the board, and what it takes to drive again."""

import random
import time
from collections.abc import Sequence
from dataclasses import dataclass

from sim.trace import Command
from verification.faults.fault import Fault, Outcome
from verification.faults.stack_fixture import SPEED_MPS, StackFixture
from verification.harness.trace import first_stop_s, last_move_s, moves
from verification.harness.waiting import becomes_true

HOLD_ON_S = (
    0.7  # after the fault, with motion still requested: the vehicle may only drive on by itself
)
REARM_S = 2.5
LATCHED_S = 0.3


@dataclass(frozen=True, slots=True)
class Sample:
    """The result of a trial."""

    stopped_s: float | None  # until the first STOP or BRAKE
    moved_s: float  # until the last command that moves the vehicle, while the fault lasted
    outcome: Outcome | None  # None: it does not drive again
    fault_ns: int
    unrequested: bool = False  # a motion command that no driver requested
    ended: tuple[str, ...] = ()  # processes that had to survive
    death_s: float = 0.0  # that the kernel took to end the killed process


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
    fault_ns = fault.inject(fixture)
    end_s = fault_ns / 1e9 + fault.hold_s
    time.sleep(max(0.0, end_s - time.monotonic()))
    fixture.frames.follow()
    commands = list(fixture.frames.commands)
    moving = fixture.moving()
    ended = fixture.ended() if fault.harmless else ()
    fault.restore(fixture)
    stopped = first_stop_s(commands, fault_ns, fault.stops)
    outcome = "drives on" if moving and stopped is None else _outcome(fixture)
    moved_s = last_move_s(commands, fault_ns)
    return Sample(
        stopped,
        moved_s,
        outcome,
        fault_ns,
        unrequested(fixture.frames.commands),
        ended,
        fixture.death_s,
    )


def _outcome(fixture: StackFixture) -> Outcome | None:
    if becomes_true(lambda: fixture.restart_ended().moving(), HOLD_ON_S):
        return "by itself"
    if fixture.rearm(LATCHED_S if fixture.latched() else REARM_S):
        return "after a neutral"
    latched = False
    for _ in range(10):
        fixture.restart_ended().request(0.0)
        time.sleep(0.1)
        latched = latched or (fixture.latched() and not fixture.flapping())
        fixture.reset()
        if fixture.rearm(REARM_S):
            return "after a reset" if latched else "after a neutral"
    return None
