"""One fault, tried once: what the board was told after it, and what it took to drive on."""

import random
import time
from dataclasses import dataclass

from verification.faults.catalogue import Fault, Outcome
from verification.faults.frames import first_stop_s, last_move_s, strayed
from verification.faults.stack_fixture import Lane, until

HOLD_ON_S = 0.7  # after the fault is mended, with the stick still held: nothing may move
REARM_S = 2.5
LATCHED_S = 0.3


@dataclass(frozen=True, slots=True)
class Sample:
    """What came of it."""

    told_s: float | None  # to the first STOP or BREAK
    moved_s: float  # to the last command to move while the fault lasted
    outcome: Outcome | None  # None: it would not drive again
    fault_ns: int
    strayed: bool = False  # a command to move otherwise than anybody asked
    died: tuple[str, ...] = ()  # that should have lived
    death_s: float = 0.0  # that the kernel took to end what was killed


def tried(lane: Lane, fault: Fault) -> Sample:
    """Bring the vehicle to speed, let the fault happen, mend it, and see what it takes."""
    lane.ready()
    time.sleep(random.random() * 0.06)  # anywhere between two requests
    lane.death_s = 0.0
    fault_ns = fault.inject(lane)
    end_s = fault_ns / 1e9 + fault.hold_s
    time.sleep(max(0.0, end_s - time.monotonic()))
    lane.frames.follow()
    commands = list(lane.frames.commands)
    moving = lane.moving()
    died = lane.dead() if fault.harmless else ()
    fault.mend(lane)
    stopped = first_stop_s(commands, fault_ns, fault.stops)
    outcome = "drives on" if moving and stopped is None else _outcome(lane)
    moved_s = last_move_s(commands, fault_ns)
    return Sample(
        stopped, moved_s, outcome, fault_ns, strayed(lane.frames.commands), died, lane.death_s
    )


def _outcome(lane: Lane) -> Outcome | None:
    if until(lambda: lane.revive().moving(), HOLD_ON_S):
        return "by itself"
    if lane.rearm(LATCHED_S if lane.latched() else REARM_S):
        return "after a neutral"
    latched = False
    for _ in range(10):
        lane.revive().ask(0.0)
        time.sleep(0.1)
        latched = latched or (lane.latched() and not lane.flapping())
        lane.reset()
        if lane.rearm(REARM_S):
            return "after a reset" if latched else "after a neutral"
    return None
