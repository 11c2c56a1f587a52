"""The faults that are tried, with what ``safety.md`` allows for each.

A budget is what the limit in force allows, plus what a process needs to notice: 50 ms where a
limit of time is waited for, less where the news is pushed.
"""

import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from cli.settings import Everything
from sim.requests import Driver, Freeze, PowerCycle, Sonar, SonarName, Wire
from tests.faults import deeds
from tests.faults.deeds import do, kill, second
from tests.faults.lane import Lane

# How the vehicle came to drive again, by rising effort.
Outcome = Literal["drives on", "by itself", "after a neutral", "after a reset"]
Budget = Callable[[Everything], float]  # s from the fault to the last command to move

NOTICE_S = 0.05


@dataclass(frozen=True, slots=True)
class Fault:
    """One kind of fault."""

    name: str
    inject: Callable[[Lane], int]  # do it; return when, in ns of the monotonic clock
    outcome: tuple[Outcome, ...]  # what ``safety.md`` allows
    budget: Budget | None = None  # None where the vehicle may drive on
    mend: Callable[[Lane], None] = lambda lane: lane.mend()
    hold_s: float = 0.5  # how long the stick is held on after the fault
    harmless: bool = False  # no process may end by it


def by_limit(limit: Callable[[Everything], float]) -> Budget:
    """Allow a limit of time and what it takes to notice."""
    return lambda config: limit(config) + NOTICE_S


def within(seconds: float) -> Budget:
    """Allow so much, whatever the limits in force."""
    return lambda _: seconds


MOTION_LEASE = by_limit(lambda config: config.bridge.lease)
HEARTBEAT = by_limit(lambda config: config.bridge.heartbeat)
SILENCE = by_limit(lambda config: config.bridge.silence)
REQUEST_LEASE = by_limit(lambda config: config.safety.sources["teleop"].lease)


HOLD_S = 0.8
FREEZE_S = 0.5
OFF_S = 0.3

ON: tuple[Outcome, ...] = ("drives on",)
ITSELF: tuple[Outcome, ...] = ("by itself",)
NEUTRAL: tuple[Outcome, ...] = ("after a neutral",)
RESET: tuple[Outcome, ...] = ("after a reset",)


def signals(name: str, then: tuple[Outcome, ...], budget: Budget | None) -> list[Fault]:
    """Return what comes of a part that is killed, stopped, or asked to end."""
    return [
        Fault(f"{name} SIGKILL", kill(name, signal.SIGKILL), then, budget, hold_s=HOLD_S),
        Fault(f"{name} SIGSTOP", kill(name, signal.SIGSTOP), then, budget, deeds.go_on(name),
              hold_s=HOLD_S),
        Fault(f"{name} SIGTERM", kill(name, signal.SIGTERM), then, budget, hold_s=HOLD_S),
    ]  # fmt: skip


def wire(**what: float) -> Callable[[Lane], int]:
    """Disturb what the board sends."""
    return do(Wire(direction="to_pc", **what))


FORWARD: tuple[SonarName, ...] = ("front_left", "front", "front_right")

# Budgets of milliseconds: nothing else runs beside these.
QUIET = [
    Fault("contact", deeds.hit(0.3), RESET, within(0.02)),
    Fault("contact in one sample", deeds.hit(0.0), RESET, within(0.02)),
    Fault("estop", deeds.estop, RESET, within(0.02)),
    Fault("bridge SIGKILL", kill("bridge", signal.SIGKILL), NEUTRAL, within(0.01)),
    Fault("settings spoilt, bridge SIGKILL", deeds.spoil_config, NEUTRAL, within(0.01),
          deeds.restore_config),
    Fault("bridge out of memory", deeds.starve, NEUTRAL, within(0.01), hold_s=1.0),
]  # fmt: skip

PROCESSES = [
    Fault("bridge SIGSTOP", kill("bridge", signal.SIGSTOP), NEUTRAL, HEARTBEAT, hold_s=HOLD_S),
    Fault("bridge SIGTERM", kill("bridge", signal.SIGTERM), NEUTRAL, within(0.05), hold_s=HOLD_S),
    Fault("guard SIGKILL", kill("guard", signal.SIGKILL), NEUTRAL, within(0.05), hold_s=HOLD_S),
    Fault("guard SIGSTOP", kill("guard", signal.SIGSTOP), ON, None, deeds.go_on("guard")),
    Fault("guard SIGTERM", kill("guard", signal.SIGTERM), NEUTRAL, within(0.05), hold_s=HOLD_S),
    # A safety that stood still for long could hear no emergency stop, and its latches outlive it.
    *signals("safety", (*NEUTRAL, *RESET), MOTION_LEASE),
    # Safety that loses its bus can hear no emergency stop: that is latched.
    *signals("router", (*NEUTRAL, *RESET), MOTION_LEASE),
    Fault("router gone for 5 s", kill("router", signal.SIGKILL), RESET, MOTION_LEASE, hold_s=5.0),
    # A driver that goes on has a stick that is still held: its next request counts.
    *signals("driver", (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    *signals("odom", ON, None),
    Fault("a second bridge", second("bridge"), ON, None, deeds.end_others, hold_s=HOLD_S),
    # Its heartbeats mix with the first one's in what drivers echo; it never reaches the wheels.
    Fault("a second safety", second("safety"), (*ON, *ITSELF), None, deeds.end_others, hold_s=1.5),
    Fault("a second driver of one name", deeds.second_driver, (*ON, *ITSELF), None,
          deeds.end_others, hold_s=1.5),
]  # fmt: skip

BOARD = [
    # What waits in a frozen board is read when it thaws, the last of it first of all STOP.
    Fault("board freeze of 0.5 s", do(Freeze(seconds=FREEZE_S)), NEUTRAL, within(FREEZE_S + 0.05),
          hold_s=HOLD_S),
    Fault("board restart in 0.3 s", do(PowerCycle(seconds=OFF_S)), (*NEUTRAL, *RESET),
          within(OFF_S + 0.1), hold_s=HOLD_S),
    Fault("board not heard", wire(drop=1.0), NEUTRAL, SILENCE),
    Fault("board answers 0.5 s late", wire(delay=0.5), NEUTRAL, SILENCE, hold_s=1.0),
    Fault("board's datagrams from elsewhere", wire(foreign=1.0), NEUTRAL, SILENCE),
    # The header has no CRC: an echo whose id is damaged can read as a bumper that is hit.
    Fault("board's datagrams all damaged", wire(corrupt=1.0), (*NEUTRAL, *RESET), SILENCE),
    Fault("board's datagrams twice, out of order", wire(duplicate=0.5, reorder=0.3),
          (*ON, *ITSELF, *NEUTRAL), None),
    Fault("left driver fault", do(Driver(side="left", bits=1)), RESET, within(0.1)),
    Fault("right driver fault", do(Driver(side="right", bits=1 << 3)), RESET, within(0.1)),
    *(
        Fault(f"{name} sonar faulty", do(Sonar(name=name, fault=True)), ITSELF, within(0.15),
              deeds.sonar_well(name))
        for name in FORWARD
    ),
    Fault("rear sonar faulty", do(Sonar(name="rear", fault=True)), ON, None,
          deeds.sonar_well("rear")),
    # Noticed after 0.5 m without a change.
    Fault("front sonar stuck", do(Sonar(name="front", range=3.0)), ITSELF, within(1.0),
          deeds.sonar_well("front"), hold_s=1.3),
    Fault("a stranger's 20 000 datagrams/s", deeds.flood, ON, None, deeds.end_others, hold_s=1.0),
]  # fmt: skip

HOSTILE = [
    Fault(f"{what} on every key", deeds.say(payload), (*ON, *ITSELF, *NEUTRAL, *RESET), None,
          harmless=True)
    for what, payload in deeds.HOSTILE.items()
]  # fmt: skip

FAULTS = [*QUIET, *PROCESSES, *BOARD, *HOSTILE]
