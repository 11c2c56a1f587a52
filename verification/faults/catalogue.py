"""The catalogue of faults, with the reaction that ``docs/safety.md`` allows for each."""

import signal
from collections.abc import Callable
from typing import get_args

from msgspec.structs import replace
from zenoh import CongestionControl

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
from verification.faults import browser, forgery, injectors, operator_faults, relay_faults
from verification.faults.fault import (
    BUMPER_AGE,
    HEARTBEAT,
    KEEPALIVE,
    LIMIT_LEASE,
    MOTION_LEASE,
    REQUEST_LEASE,
    SILENCE,
    ULTRASONIC_AGE,
    VELOCITY_AGE,
    ZEROS,
    Budget,
    Fault,
    Outcome,
    by_limit,
    within,
)
from verification.faults.injectors import do, kill, second
from verification.faults.namespaces import Requirement
from verification.faults.stack_fixture import StackFixture
from verification.faults.surroundings import (
    cut_and_let_go,
    empty_disk,
    fill_disk,
    network,
    restore_clocks,
    restore_network,
    starve,
    step_time_of_day,
)

HOLD_S, FREEZE_S, OFF_S = 0.6, 0.5, 0.3

ON: tuple[Outcome, ...] = ("drives on",)
ITSELF: tuple[Outcome, ...] = ("by itself",)
NEUTRAL: tuple[Outcome, ...] = ("after a neutral",)
RESET: tuple[Outcome, ...] = ("after a reset",)


def signals(
    name: str,
    then: tuple[Outcome, ...],
    budget: Budget | None,
    *,
    terminated: Budget | None = None,
    needs: Requirement = "none",
) -> list[Fault]:
    """Return SIGKILL, SIGSTOP and SIGTERM of a process; ``terminated`` is the budget of SIGTERM."""
    return [
        Fault(f"{name} SIGKILL", kill(name, signal.SIGKILL), then, budget, hold_s=HOLD_S,
              needs=needs),
        Fault(f"{name} SIGSTOP", kill(name, signal.SIGSTOP), then, budget, injectors.go_on(name),
              hold_s=HOLD_S, needs=needs),
        Fault(f"{name} SIGTERM", kill(name, signal.SIGTERM), then, terminated or budget,
              hold_s=HOLD_S, needs=needs),
    ]  # fmt: skip


def wire(**what: float) -> Callable[[StackFixture], int]:
    """Disturb the datagrams from the board."""
    return do(replace(Wire(direction="to_pc"), **what))


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
    # A safety that was stopped could not receive an emergency stop; its latches outlive it.
    *signals("safety", (*NEUTRAL, *RESET), MOTION_LEASE),
    # Without the bus safety cannot receive an emergency stop: it latches that.
    *signals("router", (*NEUTRAL, *RESET), MOTION_LEASE),
    Fault("router gone for 5 s", kill("router", signal.SIGKILL), RESET, MOTION_LEASE, hold_s=5.0),
    # With Zenoh's default congestion control (drop) the sender drops a message of this size.
    Fault("estop with 1 MB in it", injectors.estop_by(
        lambda session, key: session.put(
            key, b"x" * 1_000_000, congestion_control=CongestionControl.BLOCK)),
          RESET, within(0.1)),
    # A continued driver still requests motion: its next request counts.
    *signals("driver", (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    # The real teleop in a terminal with W held; ``driver`` above only sends its requests.
    *signals("teleop", (*NEUTRAL, *ITSELF), REQUEST_LEASE, terminated=ZEROS, needs="teleop"),
    *signals("odom", ON, None),
    # Its silence stops the vehicle, by the settings of this stack.
    Fault("limit source SIGKILL, silence = stop", kill("limiter", signal.SIGKILL), NEUTRAL,
          LIMIT_LEASE, needs="third parties"),
    Fault("pendant SIGKILL", kill("pendant", signal.SIGKILL), RESET, KEEPALIVE, hold_s=1.5,
          needs="third parties"),
    Fault("a second bridge", second("bridge"), ON, None, injectors.end_others, hold_s=HOLD_S),
    # Its heartbeats mix with the first one's in the drivers' echoes; its motions have no effect.
    Fault("a second safety", second("safety"), (*ON, *ITSELF), None,
          injectors.end_others, hold_s=1.5),
    Fault("a second driver of one name", injectors.second_driver, (*ON, *ITSELF), None,
          injectors.end_others, hold_s=1.5),
    # Log lines that cannot be written are lost; no service waits for the disk.
    Fault("disk full, then contact", fill_disk, RESET, within(0.05), empty_disk, harmless=True,
          needs="small disk"),
]  # fmt: skip

NETWORK = [
    Fault("driver's network cut for 3 s", network(Wire(drop=1.0)), (*ITSELF, *NEUTRAL),
          REQUEST_LEASE, restore_network, hold_s=3.0, needs="remote driver"),
    # The stick was released meanwhile: no earlier request may move the vehicle any more.
    *(
        Fault(f"driver's network cut for {seconds:g} s, then the burst", cut_and_let_go(seconds),
              NEUTRAL, REQUEST_LEASE, restore_network, hold_s=seconds + 1.0, needs="remote driver")
        for seconds in (0.8, 3.0)
    ),
    Fault("all from the driver 1 s late", network(Wire(direction="to_pc", delay=1.0)),
          (*ITSELF, *NEUTRAL), REQUEST_LEASE, restore_network, hold_s=2.0, needs="remote driver"),
    *(
        Fault(f"driver's network: {what}", network(faults), (*ON, *ITSELF, *NEUTRAL), None,
              restore_network, hold_s=1.5, needs="remote driver")
        for what, faults in {
            "1 % lost": Wire(drop=0.01),
            "10 % lost": Wire(drop=0.1),
            "30 % lost": Wire(drop=0.3),
            "200 ms late, up to 50 ms more": Wire(direction="to_pc", delay=0.2, jitter=0.05),
            "25 % twice, 25 % out of order": Wire(duplicate=0.25, reorder=0.25),
        }.items()
    ),
]  # fmt: skip

# A step of 0 h is the control: a separate clock alone changes nothing.
CLOCKS = [
    Fault(f"{whose}'s clock stepped by {hours:+d} h", step_time_of_day(whose, 3600 * hours), ON,
          None, restore_clocks, hold_s=1.5, needs="separate clocks")
    for whose in ("robot", "driver")
    for hours in (0, 1, -1)
]  # fmt: skip

BOARD = [
    # A frozen board reads its queue when it continues; the newest command in it is STOP.
    Fault("board freeze of 0.5 s", do(Freeze(seconds=FREEZE_S)), NEUTRAL, within(FREEZE_S + 0.05),
          hold_s=HOLD_S),
    Fault("board restart in 0.3 s", do(PowerCycle(seconds=OFF_S)), (*NEUTRAL, *RESET),
          within(OFF_S + 0.1), hold_s=HOLD_S),
    Fault("board not heard", wire(drop=1.0), NEUTRAL, SILENCE),
    Fault("board answers 0.5 s late", wire(delay=0.5), NEUTRAL, SILENCE, hold_s=1.0),
    Fault("board's datagrams from elsewhere", wire(foreign=1.0), NEUTRAL, SILENCE),
    # The header has no CRC: an echo with a damaged id can read as a pressed bumper.
    Fault("board's datagrams all damaged", wire(corrupt=1.0), (*NEUTRAL, *RESET), SILENCE),
    Fault("board's datagrams twice, out of order", wire(duplicate=0.5, reorder=0.3),
          (*ON, *ITSELF, *NEUTRAL), None),
    Fault("left driver fault", do(Driver(side="left", bits=1)), RESET, within(0.1)),
    Fault("right driver fault", do(Driver(side="right", bits=1 << 3)), RESET, within(0.1)),
    *(
        Fault(f"{name} sonar faulty", do(Sonar(name=name, fault=True)), ITSELF, within(0.15),
              injectors.restore_sonar(name))
        for name in FORWARD
    ),
    # Suspect after 0.5 m without a change: the speed limit drops.
    *(
        Fault(f"{name} sonar stuck", do(Sonar(name=name, range=3.0)), ON, None,
              injectors.restore_sonar(name), hold_s=1.3)
        for name in FORWARD
    ),
    *(
        Fault(f"{name} sonar {what}", do(sonar), ON, None, injectors.restore_sonar(name),
              hold_s=0.8)
        for name in ELSEWHERE
        for what, sonar in {
            "faulty": Sonar(name=name, fault=True), "stuck": Sonar(name=name, range=3.0),
        }.items()
    ),
    # One frame reports all eight.
    Fault("sonars silent", do(Mute(reports=("ultrasonic",))), ITSELF, ULTRASONIC_AGE),
    Fault("bumper silent", do(Mute(reports=("bumper",))), NEUTRAL, BUMPER_AGE),
    Fault("velocity silent", do(Mute(reports=("velocity",))), NEUTRAL, VELOCITY_AGE),
    # The vehicle drives further than the largest accepted step of the counters.
    Fault("mileage silent for 4 s", injectors.silent("mileage", 4.0), ON, None, hold_s=4.8),
]  # fmt: skip

# Other firmware behaviour.
FIRMWARE = [
    Fault("contact while every third answer is lost",
          injectors.in_sequence(do(Lose(reports=("bumper",))), injectors.hit(0.06)), RESET,
          within(0.02)),
    Fault("contact reported on the other port",
          injectors.in_sequence(do(Firmware(hits="second")), injectors.hit(0.3)), RESET,
          within(0.02)),
    # The bridge changes to the other port after 0.1 s without an answer.
    Fault("board answers on the other port", do(Firmware(answers="second")),
          (*ON, *ITSELF, *NEUTRAL), None),
    Fault("board restart in 0.12 s", do(PowerCycle(seconds=0.12)), (*NEUTRAL, *RESET),
          within(0.12 + 0.1), hold_s=HOLD_S),
    # While safety is dead only the bridge detects that STOP has no effect.
    Fault("safety SIGKILL, the board ignores STOP",
          injectors.in_sequence(
              do(Firmware(ignores=(Command.STOP,))), kill("safety", signal.SIGKILL)),
          (*NEUTRAL, *RESET), by_limit(lambda config: config.bridge.lease + config.bridge.coast),
          hold_s=2.0, stops=("brake",)),
]  # fmt: skip

GREEDY = [
    Fault("bridge out of memory", starve("bridge"), NEUTRAL, within(0.01), hold_s=1.0,
          needs="memory cgroup"),
    *(
        Fault(f"{name} out of memory", starve(name), then, budget, hold_s=HOLD_S,
              needs="memory cgroup")
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
    # More than the bridge can publish: answers to its queries are lost, the bumper's first.
    Fault("board's 20 000 datagrams/s of velocities", do(Flood(seconds=0.9)),
          (*ON, *ITSELF, *NEUTRAL), None, hold_s=1.0, harmless=True),
]  # fmt: skip

HOSTILE = [
    Fault(f"{what} on every key", publish, (*ON, *ITSELF, *NEUTRAL, *RESET), None, harmless=True)
    for what, publish in injectors.HOSTILE.items()
]  # fmt: skip

DASHBOARD = [
    Fault("browser's estop while a viewer sends 50 000 messages/s",
          browser.estop_while(browser.flood), RESET, within(0.3)),
    Fault("browser's estop while 500 requests do not end",
          browser.estop_while(browser.unfinished), RESET, within(0.3)),
]  # fmt: skip

DRIVE_LINK = [
    Fault("safety hangs, then contact", forgery.hit_while_safety_hangs, RESET, within(0.02),
          injectors.go_on("safety")),
    Fault("safety hangs for 2 s, then estop", forgery.estop_while_safety_hangs, RESET,
          within(0.02), injectors.go_on("safety"), stops=("brake",)),
    *(
        Fault(what, forgery.forged(forge), ON, None, harmless=True)
        for what, forge in {
            "safety's authority copied": forgery.authority,
            "safety's number overtaken": forgery.lock_out,
            "bridge's measurements copied": forgery.measurements,
        }.items()
    ),
]  # fmt: skip

# Groups that run in parallel, the most sensitive to host load first.
GROUPS = [
    [*MILLISECONDS, *CLOCKS],
    [*GREEDY, *DASHBOARD],
    [*PROCESSES, *NETWORK, *BOARD, *FIRMWARE, *HOSTILE, *operator_faults.TERMINAL, *DRIVE_LINK,
     *operator_faults.CALLS, *relay_faults.RELAY],
]  # fmt: skip
FAULTS = [fault for group in GROUPS for fault in group]
