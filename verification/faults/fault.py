"""A fault of the catalogue, one trial of it, and the verdict on its samples.

A budget is the effective time limit plus the time to detect it: 50 ms where a timeout has to
expire, less where the fault is signalled.
"""

import math
import random
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median_low
from typing import Literal, get_args

from cli.settings import Everything
from common import clock
from common.freshness import NS_PER_S
from sim.trace import Command
from verification.faults.stack_fixture import SPEED_MPS, Requirement, StackFixture
from verification.harness.host import StallRecorder
from verification.harness.trace import first_stop_s, last_move_s, moves
from verification.harness.waiting import becomes_true

# How the vehicle drives again, by rising effort.
Outcome = Literal["drives on", "by itself", "after a neutral", "after a reset"]
Budget = Callable[[Everything], float]  # s from the fault to the last command to move
# Returns the time of the fault, in ns of the monotonic clock; None: the time of the call.
Injector = Callable[[StackFixture], int | None]

NOTICE_S = 0.05
BEYOND_S = 0.25  # how long requests go on after the budget
STALL_S = 0.05  # a longer stall of the host stops the vehicle, too; that needs no reset
# After the fault, with motion still requested: the vehicle may only drive on by itself.
HOLD_ON_S = 0.7
REARM_S = 2.5
LATCHED_S = 0.3
HEAD = "fault", "n", "budget", "median", "worst", "stall", "then", "date", ""


@dataclass(frozen=True, slots=True)
class Fault:
    """One kind of fault."""

    name: str
    inject: Injector
    outcome: tuple[Outcome, ...]  # allowed by docs/safety.md
    budget: Budget | None = None  # None where the vehicle may drive on
    hold_s: float = 0.6  # how long requests go on after the fault
    harmless: bool = False  # no process may end because of it
    needs: Requirement = "none"
    stops: tuple[str, ...] = ("stop", "brake")  # commands that count as a reaction


def by_limit(limit: Callable[[Everything], float]) -> Budget:
    """Return a budget of a time limit plus the detection time."""
    return lambda config: limit(config) + NOTICE_S


def within(seconds: float) -> Budget:
    """Return a fixed budget."""
    return lambda _: seconds


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

    @property
    def reaction_s(self) -> float:
        """The later one of the first STOP or BRAKE and the last command that moves the vehicle."""
        return max(math.inf if self.stopped_s is None else self.stopped_s, self.moved_s)


@dataclass(frozen=True, slots=True)
class Row:
    """One fault and its trials."""

    fault: Fault
    budget_s: float | None
    samples: Sequence[Sample]
    stalls_s: Sequence[float]  # longest stall of the host during each sample

    @property
    def allowances_s(self) -> list[float]:
        """Time that the host took in each sample: a stall, or ending a killed process."""
        pairs = zip(self.samples, self.stalls_s, strict=True)
        return [stall + sample.death_s for sample, stall in pairs]

    @property
    def violations(self) -> list[str]:
        """Return the violations of all samples."""
        allowed = " or ".join(self.fault.outcome)
        efforts = get_args(Outcome)
        stopped = efforts[efforts.index(self.fault.outcome[0]) : efforts.index("after a reset")]
        found = []
        for sample, stall_s, allowance_s in zip(
            self.samples, self.stalls_s, self.allowances_s, strict=True
        ):
            by_stall = stall_s > STALL_S and sample.outcome in stopped
            if sample.outcome not in self.fault.outcome and not by_stall:
                found.append(f"{sample.outcome or 'does not drive again'}, not {allowed}")
            if sample.unrequested:
                found.append("a motion command without a request")
            found += [f"{name} ended" for name in sample.ended]
            if self.budget_s is not None and sample.reaction_s > self.budget_s + allowance_s:
                limit = _ms(self.budget_s + allowance_s)
                found.append(f"{_ms(sample.reaction_s)}, {limit} are allowed")
        return found

    def line(self, date: str) -> str:
        """Return the row of the page's table."""
        times = ["", "", ""]
        if self.budget_s is not None:
            took = [sample.reaction_s for sample in self.samples]
            times = [_ms(self.budget_s), _ms(median_low(took)), _ms(max(took))]
        count = len(self.samples)
        outcomes = Counter(sample.outcome or "does not drive again" for sample in self.samples)
        then = ", ".join(name if n == count else f"{name} {n}" for name, n in outcomes.items())
        cells = [
            self.fault.name, str(count), *times, _ms(max(self.allowances_s)), then, date,
            "WRONG" if self.violations else "ok",
        ]  # fmt: skip
        return f"| {' | '.join(cells)} |"


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.1f} ms" if math.isfinite(seconds) else "never"


def unrequested(commands: Sequence[Command]) -> bool:
    """Return whether any command moves the vehicle in a way that no driver requested."""
    return any(
        moves(c) and not (0.0 <= c.linear <= SPEED_MPS + 0.01 and c.angular == 0.0)
        for c in commands
    )


def run_row(fixture: StackFixture, fault: Fault, stalls: StallRecorder, repeat: int = 1) -> Row:
    """Run the trials of a fault; it outlasts its budget, which is longer on a slow host."""
    budget_s = fault.budget(fixture.running.config) if fault.budget else None
    if budget_s is not None:
        fault = replace(fault, hold_s=max(fault.hold_s, budget_s + BEYOND_S))
    samples = [run_trial(fixture, fault) for _ in range(repeat)]
    return Row(
        fault, budget_s, samples, [stalls.worst_s(it.fault_ns, fault.hold_s) for it in samples]
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
