"""The faults that are tried, with what ``safety.md`` allows for each.

A budget is what the limit in force allows, plus what a process needs to notice: 50 ms where a
limit of time is waited for, less where the news is pushed.
"""

import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

from zenoh import CongestionControl

from cli.settings import Everything
from common.motion import Command
from sim.requests import (
    Driver,
    Firmware,
    Flood,
    Freeze,
    Lose,
    Mute,
    PowerCycle,
    Sonar,
    SonarName,
    Wire,
)
from verification.faults import browser, forgery, injectors
from verification.faults.injectors import do, kill, second
from verification.faults.namespaces import Need
from verification.faults.stack_fixture import Lane
from verification.faults.surroundings import (
    cable,
    cut_and_let_go,
    empty_disk,
    fill_disk,
    mend_cable,
    set_clocks_right,
    starve,
    step,
)

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
    needs: Need = "nothing"
    stops: tuple[str, ...] = ("stop", "brake")  # commands that end the fault's danger


def by_limit(limit: Callable[[Everything], float]) -> Budget:
    """Allow a limit of time and what it takes to notice."""
    return lambda config: limit(config) + NOTICE_S


def within(seconds: float) -> Budget:
    """Allow so much, whatever the limits in force."""
    return lambda _: seconds


MOTION_LEASE = by_limit(lambda config: config.bridge.lease)
HEARTBEAT = by_limit(lambda config: config.bridge.heartbeat)
SILENCE = by_limit(lambda config: config.bridge.silence)
BUMPER_AGE = by_limit(lambda config: config.safety.bumper_age)
VELOCITY_AGE = by_limit(lambda config: config.safety.velocity_age)
ULTRASONIC_AGE = by_limit(lambda config: config.safety.ultrasonic_age)
REQUEST_LEASE = by_limit(lambda config: config.safety.sources["teleop"].lease)
# Who lets go says three zeros, 50 ms apart; the last of them holds for its lease.
ZEROS = by_limit(lambda config: 0.15 + config.safety.sources["teleop"].lease)

HOLD_S = 0.6
FREEZE_S = 0.5
OFF_S = 0.3

ON: tuple[Outcome, ...] = ("drives on",)
ITSELF: tuple[Outcome, ...] = ("by itself",)
NEUTRAL: tuple[Outcome, ...] = ("after a neutral",)
RESET: tuple[Outcome, ...] = ("after a reset",)


def signals(
    name: str,
    then: tuple[Outcome, ...],
    budget: Budget | None,
    *,
    asked: Budget | None = None,
    needs: Need = "nothing",
) -> list[Fault]:
    """Return what comes of a part that is killed, stopped, or ``asked`` to end."""
    told = asked or budget
    return [
        Fault(f"{name} SIGKILL", kill(name, signal.SIGKILL), then, budget, hold_s=HOLD_S,
              needs=needs),
        Fault(f"{name} SIGSTOP", kill(name, signal.SIGSTOP), then, budget, injectors.go_on(name),
              hold_s=HOLD_S, needs=needs),
        Fault(f"{name} SIGTERM", kill(name, signal.SIGTERM), then, told, hold_s=HOLD_S,
              needs=needs),
    ]  # fmt: skip


def wire(**what: float) -> Callable[[Lane], int]:
    """Disturb what the board sends."""
    return do(Wire(direction="to_pc", **what))


FORWARD: tuple[SonarName, ...] = ("front_left", "front", "front_right")
ELSEWHERE = tuple(name for name in get_args(SonarName) if name not in FORWARD)

MILLISECONDS = [
    Fault("contact", injectors.hit(0.3), RESET, within(0.02)),
    Fault("contact in one sample", injectors.hit(0.0), RESET, within(0.02)),
    Fault("estop", injectors.estop, RESET, within(0.02)),
    Fault("estop by anybody's DELETE", injectors.estop_by(lambda session, key: session.delete(key)),
          RESET, within(0.02)),
    Fault("estop of all, garbage in it", injectors.estop_by(
        lambda session, _: session.put("t2/v1/*/estop", b"\xc1", encoding="text/plain")),
          RESET, within(0.02)),
    Fault("bridge SIGKILL", kill("bridge", signal.SIGKILL), NEUTRAL, within(0.01)),
    Fault("settings spoilt, bridge SIGKILL", injectors.spoil_config, NEUTRAL, within(0.01),
          injectors.restore_config),
]  # fmt: skip

PROCESSES = [
    Fault("bridge SIGSTOP", kill("bridge", signal.SIGSTOP), NEUTRAL, HEARTBEAT, hold_s=HOLD_S),
    Fault("bridge SIGTERM", kill("bridge", signal.SIGTERM), NEUTRAL, within(0.05), hold_s=HOLD_S),
    Fault("guard SIGKILL", kill("guard", signal.SIGKILL), NEUTRAL, within(0.05), hold_s=HOLD_S),
    Fault("guard SIGSTOP", kill("guard", signal.SIGSTOP), ON, None, injectors.go_on("guard")),
    Fault("guard SIGTERM", kill("guard", signal.SIGTERM), NEUTRAL, within(0.05), hold_s=HOLD_S),
    # A safety that stood still for long could hear no emergency stop, and its latches outlive it.
    *signals("safety", (*NEUTRAL, *RESET), MOTION_LEASE),
    # Safety that loses its bus can hear no emergency stop: that is latched.
    *signals("router", (*NEUTRAL, *RESET), MOTION_LEASE),
    Fault("router gone for 5 s", kill("router", signal.SIGKILL), RESET, MOTION_LEASE, hold_s=5.0),
    # A put that may be dropped, Zenoh's default, is dropped at its sender when it is so large.
    Fault("estop with 1 MB in it", injectors.estop_by(
        lambda session, key: session.put(
            key, b"x" * 1_000_000, congestion_control=CongestionControl.BLOCK)),
          RESET, within(0.1)),
    # A driver that goes on has a stick that is still held: its next request counts.
    *signals("driver", (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    # The real one in a terminal, a finger on W; whoever only asks, as it does, is the driver.
    *signals("teleop", (*NEUTRAL, *ITSELF), REQUEST_LEASE, asked=ZEROS, needs="a teleop"),
    *signals("odom", ON, None),
    Fault("a second bridge", second("bridge"), ON, None, injectors.end_others, hold_s=HOLD_S),
    # Its heartbeats mix with the first one's in what drivers echo; it never reaches the wheels.
    Fault("a second safety", second("safety"), (*ON, *ITSELF), None,
          injectors.end_others, hold_s=1.5),
    Fault("a second driver of one name", injectors.second_driver, (*ON, *ITSELF), None,
          injectors.end_others, hold_s=1.5),
    # What cannot be written is lost; nobody waits for it.
    Fault("disk full, then contact", fill_disk, RESET, within(0.05), empty_disk, harmless=True,
          needs="a small disk"),
]  # fmt: skip

NETWORK = [
    Fault("driver's network cut for 3 s", cable(Wire(drop=1.0)), (*ITSELF, *NEUTRAL),
          REQUEST_LEASE, mend_cable, hold_s=3.0, needs="a far driver"),
    # The stick was let go meanwhile: of all that was asked before, nothing may move it any more.
    *(
        Fault(f"driver's network cut for {seconds:g} s, then the burst", cut_and_let_go(seconds),
              NEUTRAL, REQUEST_LEASE, mend_cable, hold_s=seconds + 1.0, needs="a far driver")
        for seconds in (0.8, 3.0)
    ),
    Fault("all from the driver 1 s late", cable(Wire(direction="to_pc", delay=1.0)),
          (*ITSELF, *NEUTRAL), REQUEST_LEASE, mend_cable, hold_s=2.0, needs="a far driver"),
    *(
        Fault(f"driver's network: {what}", cable(faults), (*ON, *ITSELF, *NEUTRAL), None,
              mend_cable, hold_s=1.5, needs="a far driver")
        for what, faults in {
            "1 % lost": Wire(drop=0.01),
            "10 % lost": Wire(drop=0.1),
            "30 % lost": Wire(drop=0.3),
            "200 ms late, up to 50 ms more": Wire(direction="to_pc", delay=0.2, jitter=0.05),
            "25 % twice, 25 % out of order": Wire(duplicate=0.25, reorder=0.25),
        }.items()
    ),
]  # fmt: skip

# A step of nothing is the control: that a clock of its own does nothing to a process.
CLOCKS = [
    Fault(f"{whose}'s clock stepped by {hours:+d} h", step(whose, 3600 * hours), ON, None,
          set_clocks_right, hold_s=1.5, needs="other clocks")
    for whose in ("robot", "driver")
    for hours in (0, 1, -1)
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
              injectors.sonar_well(name))
        for name in FORWARD
    ),
    # Suspect after 0.5 m without a change: slower from then on.
    *(
        Fault(f"{name} sonar stuck", do(Sonar(name=name, range=3.0)), ON, None,
              injectors.sonar_well(name), hold_s=1.3)
        for name in FORWARD
    ),
    *(
        Fault(f"{name} sonar {what}", do(sonar), ON, None, injectors.sonar_well(name), hold_s=0.8)
        for name in ELSEWHERE
        for what, sonar in {
            "faulty": Sonar(name=name, fault=True), "stuck": Sonar(name=name, range=3.0),
        }.items()
    ),
    # One frame tells of all eight.
    Fault("sonars silent", do(Mute(reports=("ultrasonic",))), ITSELF, ULTRASONIC_AGE),
    Fault("bumper silent", do(Mute(reports=("bumper",))), NEUTRAL, BUMPER_AGE),
    Fault("velocity silent", do(Mute(reports=("velocity",))), NEUTRAL, VELOCITY_AGE),
    # Long enough to drive further than a step of the counters may be.
    Fault("mileage silent for 4 s", injectors.silent("mileage", 4.0), ON, None, hold_s=4.8),
]  # fmt: skip

# What a board may do otherwise than the simulated one does.
FIRMWARE = [
    Fault("contact while every third answer is lost",
          injectors.then(do(Lose(reports=("bumper",))), injectors.hit(0.06)), RESET, within(0.02)),
    Fault("contact reported on the other port",
          injectors.then(do(Firmware(hits="second")), injectors.hit(0.3)), RESET, within(0.02)),
    # The other port is taken after a tenth of a second without an answer.
    Fault("board answers on the other port", do(Firmware(answers="second")),
          (*ON, *ITSELF, *NEUTRAL), None),
    Fault("board restart in 0.12 s", do(PowerCycle(seconds=0.12)), (*NEUTRAL, *RESET),
          within(0.12 + 0.1), hold_s=HOLD_S),
    # While safety is dead nobody but the bridge sees that STOP does not stop it.
    Fault("safety SIGKILL, the board ignores STOP",
          injectors.then(do(Firmware(ignores=(Command.STOP,))), kill("safety", signal.SIGKILL)),
          (*NEUTRAL, *RESET), by_limit(lambda config: config.bridge.lease + config.bridge.coast),
          hold_s=2.0, stops=("brake",)),
]  # fmt: skip

# These take the machine's time as well.
GREEDY = [
    Fault("bridge out of memory", starve("bridge"), NEUTRAL, within(0.01), hold_s=1.0,
          needs="a memory group"),
    *(
        Fault(f"{name} out of memory", starve(name), then, budget, hold_s=HOLD_S,
              needs="a memory group")
        for name, then, budget in (
            ("guard", NEUTRAL, within(0.05)),
            ("safety", (*NEUTRAL, *RESET), MOTION_LEASE),
            ("router", (*NEUTRAL, *RESET), MOTION_LEASE),
            ("driver", NEUTRAL, REQUEST_LEASE),
            ("odom", ON, None),
        )
    ),
    Fault("a stranger\'s 20 000 datagrams/s", injectors.flood, ON, None,
          injectors.end_others, hold_s=1.0),
    Fault("board's 20 000 datagrams/s of garbage", do(Flood(seconds=0.9, garbage=True)),
          (*ON, *NEUTRAL), None, hold_s=1.0, harmless=True),
    # More than the bridge can publish: what it asks for is lost among them, the bumper first.
    Fault("board's 20 000 datagrams/s of velocities", do(Flood(seconds=0.9)),
          (*ON, *ITSELF, *NEUTRAL), None, hold_s=1.0, harmless=True),
]  # fmt: skip

HOSTILE = [
    Fault(f"{what} on every key", saying, (*ON, *ITSELF, *NEUTRAL, *RESET), None, harmless=True)
    for what, saying in injectors.HOSTILE.items()
]  # fmt: skip

# The web server and what abuses it take the machine's time as well.
DASHBOARD = [
    Fault("browser's estop while a viewer sends 50 000 messages/s",
          browser.estop_while(browser.flood), RESET, within(0.3)),
    Fault("browser's estop while 500 requests do not end",
          browser.estop_while(browser.unfinished), RESET, within(0.3)),
]  # fmt: skip

# What a network held back has no effect: no frame moves the vehicle, and the latch stays.
OPERATORS = [
    Fault("contact, then 20 resets 1.3 s late", injectors.late_resets, RESET, within(0.02)),
    Fault("contact, then 20 releases 1.3 s late", injectors.late_releases, RESET, within(0.02)),
]

# Keys that a terminal delivers late move nothing: the hold of the last one in time ends, and that
# one may be a first press, if the one before it was refused.
TERMINAL = [
    Fault(f"teleop's terminal stalled for {seconds:g} s, then the burst",
          injectors.stall_terminal(seconds), NEUTRAL,
          by_limit(lambda config: config.teleop.hold_first + 0.15
                   + config.safety.sources["teleop"].lease),
          hold_s=seconds + 1.0, needs="a teleop")
    for seconds in (0.8, 3.0)
]  # fmt: skip

DRIVE_LINK = [
    Fault("safety hangs, then contact", forgery.hit_while_safety_hangs, RESET, within(0.02),
          injectors.go_on("safety")),
    *(
        Fault(what, forgery.forged(forge), ON, None, harmless=True)
        for what, forge in {
            "safety's authority copied": forgery.authority,
            "safety's number overtaken": forgery.lock_out,
            "bridge's measurements copied": forgery.measurements,
        }.items()
    ),
]  # fmt: skip

# What is tried beside each other, the most delicate first.
PARTS = [
    [*MILLISECONDS, *CLOCKS],
    [*GREEDY, *DASHBOARD],
    [*PROCESSES, *NETWORK, *BOARD, *FIRMWARE, *HOSTILE, *TERMINAL, *DRIVE_LINK, *OPERATORS],
]
FAULTS = [fault for part in PARTS for fault in part]
