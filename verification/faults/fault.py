"""A fault of the catalogue, and the budgets of its reaction.

A budget is the effective time limit plus the time to detect it: 50 ms where a timeout has to
expire, less where the fault is signalled.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from cli.settings import Everything
from verification.faults.namespaces import Requirement
from verification.faults.stack_fixture import StackFixture

# How the vehicle drives again, by rising effort.
Outcome = Literal["drives on", "by itself", "after a neutral", "after a reset"]
Budget = Callable[[Everything], float]  # s from the fault to the last command to move

NOTICE_S = 0.05


@dataclass(frozen=True, slots=True)
class Fault:
    """One kind of fault."""

    name: str
    # Returns the time of the fault, in ns of the monotonic clock; None: the time of the call.
    inject: Callable[[StackFixture], int | None]
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
