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
from verification.faults.third_party import LIMIT_LEASE_S

# How the vehicle drives again, by rising effort.
Outcome = Literal["drives on", "by itself", "after a neutral", "after a reset"]
Budget = Callable[[Everything], float]  # s from the fault to the last command to move

NOTICE_S = 0.05


@dataclass(frozen=True, slots=True)
class Fault:
    """One kind of fault."""

    name: str
    inject: Callable[[StackFixture], int]  # returns its time, in ns of the monotonic clock
    outcome: tuple[Outcome, ...]  # allowed by docs/safety.md
    budget: Budget | None = None  # None where the vehicle may drive on
    restore: Callable[[StackFixture], None] = lambda fixture: fixture.restore()
    hold_s: float = 0.5  # how long requests go on after the fault
    harmless: bool = False  # no process may end because of it
    needs: Requirement = "none"
    stops: tuple[str, ...] = ("stop", "brake")  # commands that count as a reaction


def by_limit(limit: Callable[[Everything], float]) -> Budget:
    """Return a budget of a time limit plus the detection time."""
    return lambda config: limit(config) + NOTICE_S


def within(seconds: float) -> Budget:
    """Return a fixed budget."""
    return lambda _: seconds


MOTION_LEASE = by_limit(lambda config: config.bridge.lease)
HEARTBEAT = by_limit(lambda config: config.bridge.heartbeat)
SILENCE = by_limit(lambda config: config.bridge.silence)
BUMPER_AGE = by_limit(lambda config: config.safety.bumper_age)
VELOCITY_AGE = by_limit(lambda config: config.safety.velocity_age)
ULTRASONIC_AGE = by_limit(lambda config: config.safety.ultrasonic_age)
REQUEST_LEASE = by_limit(lambda config: config.safety.sources["teleop"].lease)
LIMIT_LEASE = within(LIMIT_LEASE_S + NOTICE_S)
KEEPALIVE = by_limit(lambda config: config.safety.estop_keepalive_timeout)
# Teleop sends three zeros, 50 ms apart, when a key is released; the last one has its lease.
ZEROS = by_limit(lambda config: 0.15 + config.safety.sources["teleop"].lease)
