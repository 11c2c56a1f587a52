"""The catalogue of faults, with the reaction that ``docs/safety.md`` allows for each."""

import os
import signal
from dataclasses import replace
from functools import partial

from zenoh import CongestionControl

from common.motion import Command
from sim.requests import Driver, Firmware, Flood, Freeze, Mute, PowerCycle, Sonar, Wire
from verification.faults import injectors
from verification.faults.fault import NOTICE_S, Budget, Fault, Outcome, by_limit, within
from verification.faults.independent_client import BUMPER, MOTION, VELOCITY, Client
from verification.faults.injectors import (
    ESTOP,
    cable,
    delete,
    do,
    estop,
    forged,
    hit,
    kill,
    late_calls,
    network,
    pause,
    press,
    put,
    request,
    second,
    send_line,
    start_again,
    steps,
)
from verification.faults.stack_fixture import CLOCKS, LIMIT_LEASE_S, Requirement
from verification.harness.dashboard import flooded, half_open

ON: tuple[Outcome, ...] = ("drives on",)
ITSELF: tuple[Outcome, ...] = ("by itself",)
NEUTRAL: tuple[Outcome, ...] = ("after a neutral",)
RESET: tuple[Outcome, ...] = ("after a reset",)

MOTION_LEASE = by_limit(lambda config: config.bridge.times.lease)
LEASE_AND_COAST = by_limit(lambda config: config.bridge.times.lease + config.bridge.times.coast)
HEARTBEAT = by_limit(lambda config: config.bridge.times.heartbeat)
SILENCE = by_limit(lambda config: config.bridge.times.silence)
BUMPER_AGE = by_limit(lambda config: config.safety.times.bumper_age)
VELOCITY_AGE = by_limit(lambda config: config.safety.times.velocity_age)
ULTRASONIC_AGE = by_limit(lambda config: config.safety.times.ultrasonic_age)
REQUEST_LEASE = by_limit(lambda config: config.safety.leased["teleop"].lease)
KEEPALIVE = by_limit(lambda config: config.safety.estop_keepalive_timeout)
LIMIT_LEASE = within(LIMIT_LEASE_S + NOTICE_S)
# Teleop sends three zeros, 50 ms apart, when a key is released; the last one has its lease.
ZEROS = by_limit(lambda config: 0.15 + config.safety.leased["teleop"].lease)
# A key is held at most so long without a repeat; then its request has its lease.
LAST_KEY = by_limit(
    lambda config: config.teleop.hold_first + 0.15 + config.safety.leased["teleop"].lease
)


def signals(
    name: str,
    then: tuple[Outcome, ...],
    budget: Budget | None = None,
    terminated: Budget | None = None,
) -> list[Fault]:
    """Return SIGKILL, SIGSTOP and SIGTERM of a process; ``terminated`` is the budget of SIGTERM."""
    return [
        Fault(f"{name} SIGKILL", kill(name), then, budget),
        Fault(f"{name} SIGSTOP", kill(name, signal.SIGSTOP), then, budget),
        Fault(f"{name} SIGTERM", kill(name, signal.SIGTERM), then, terminated or budget),
    ]


def needing(need: Requirement, *faults: Fault) -> list[Fault]:
    """Return the faults with a requirement."""
    return [replace(fault, needs=need) for fault in faults]


ESTOP_OF_ALL = "t2/v1/*/estop"
to_pc = partial(Wire, direction="to_pc")

MILLISECONDS = [
    Fault("contact", hit(0.3), RESET, within(0.02)),
    Fault("contact in one sample", hit(0.0), RESET, within(0.02)),
    Fault("estop", estop, RESET, within(0.02)),
    Fault("estop by anybody's DELETE", delete(ESTOP), RESET, within(0.02)),
    Fault("estop of all, garbage in it", put(ESTOP_OF_ALL, b"\xc1", encoding="text/plain"),
          RESET, within(0.02)),
    Fault("bridge SIGKILL", kill("bridge"), NEUTRAL, within(0.01)),
    Fault("settings spoilt, bridge SIGKILL", injectors.spoil_config, NEUTRAL, within(0.01)),
    *needing("separate clocks", *(
        Fault(f"{whose}'s clock stepped by {hours:+d} h",
              injectors.step_time_of_day(whose, 3600 * hours), ON, hold_s=1.5)
        for whose in CLOCKS
        for hours in (1, -1)
    )),
]  # fmt: skip

PROCESSES = [
    Fault("bridge SIGSTOP", kill("bridge", signal.SIGSTOP), NEUTRAL, HEARTBEAT),
    Fault("bridge SIGTERM", kill("bridge", signal.SIGTERM), NEUTRAL, within(0.05)),
    Fault("guard SIGKILL", kill("guard"), NEUTRAL, within(0.05)),
    Fault("guard SIGSTOP", kill("guard", signal.SIGSTOP), ON),
    Fault("guard SIGTERM", kill("guard", signal.SIGTERM), NEUTRAL, within(0.05)),
    # A safety that was stopped could not receive an emergency stop; its latches outlive it.
    *signals("safety", (*NEUTRAL, *RESET), MOTION_LEASE),
    # Without the bus safety cannot receive an emergency stop: it latches that.
    *signals("router", (*NEUTRAL, *RESET), MOTION_LEASE),
    Fault("router gone for 5 s", kill("router"), RESET, MOTION_LEASE, hold_s=5.0,
          stops=("brake",)),
    # With Zenoh's default congestion control (drop) the sender drops a message of this size.
    Fault("estop with 1 MB in it",
          put(ESTOP, b"x" * 1_000_000, congestion_control=CongestionControl.BLOCK),
          RESET, within(0.1)),
    # A continued driver still requests motion: its next request counts.
    *signals("driver", (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    # The real teleop in a terminal with W held; ``driver`` above only sends its requests.
    *needing("teleop",
        *signals("teleop", (*NEUTRAL, *ITSELF), REQUEST_LEASE, ZEROS),
        # Late keys move nothing: the hold of the last key in time ends, also of a first press.
        *(
            Fault(f"teleop's terminal stalled for {seconds:g} s, then the burst",
                  steps(send_line(b"stall %f" % seconds), pause(0.3), request(0.0)),
                  NEUTRAL, LAST_KEY, hold_s=seconds + 1.0)
            for seconds in (0.8, 3.0)
        ),
    ),
    *signals("odom", ON),
    # Its silence stops the vehicle, by the settings of this stack.
    *needing("third parties",
        Fault("limit source SIGKILL, silence = stop", kill("limiter"), NEUTRAL, LIMIT_LEASE),
        Fault("pendant SIGKILL", kill("pendant"), RESET, KEEPALIVE, hold_s=1.5),
    ),
    Fault("a second bridge", second("bridge"), ON),
    # Its heartbeats mix with the first one's in the drivers' echoes; its motions have no effect. A
    # driver that echoes the second one alone for over a second needs a neutral request.
    Fault("a second safety", second("safety"), (*ON, *ITSELF, *NEUTRAL), hold_s=1.5),
    Fault("a second driver of one name", second("driver"), (*ON, *ITSELF), hold_s=1.5),
    # Log lines that cannot be written are lost; no service waits for the disk.
    Fault("disk full, then contact", injectors.fill_disk, RESET, within(0.05), harmless=True,
          needs="small disk"),
    # Delayed calls have no effect: no frame moves the vehicle, and the latch stays.
    # Safety refuses a reset while motion is requested.
    Fault("contact, then 20 resets 1.3 s late",
          steps(hit(0.1), request(0.0), late_calls("safety/reset", Client.reset_request)),
          RESET, within(0.02)),
    # A release is refused until the vehicle stands, and while a source of higher priority requests.
    Fault("contact, then 20 releases 1.3 s late",
          steps(press, request(0.0), pause(1.5), injectors.late_releases()),
          RESET, within(0.02)),
]  # fmt: skip

NETWORK = needing("remote driver",
    Fault("driver's network cut for 3 s", network(Wire(drop=1.0)), (*ITSELF, *NEUTRAL),
          REQUEST_LEASE, hold_s=3.0),
    # The stick was released meanwhile: no earlier request may move the vehicle any more.
    *(
        Fault(f"driver's network cut for {seconds:g} s, then the burst",
              steps(network(Wire(drop=1.0)), pause(0.4), request(0.0), pause(seconds - 0.4),
                    network(Wire())),
              NEUTRAL, REQUEST_LEASE, hold_s=seconds + 1.0)
        for seconds in (0.8, 3.0)
    ),
    Fault("all from the driver 1 s late", network(to_pc(delay=1.0)), (*ITSELF, *NEUTRAL),
          REQUEST_LEASE, hold_s=2.0),
    *(
        Fault(f"driver's network: {what}", network(faults), (*ON, *ITSELF, *NEUTRAL), hold_s=1.5)
        for what, faults in {
            "1 % lost": Wire(drop=0.01),
            "10 % lost": Wire(drop=0.1),
            "30 % lost": Wire(drop=0.3),
            "200 ms late, up to 50 ms more": to_pc(delay=0.2, jitter=0.05),
            "25 % twice, 25 % out of order": Wire(duplicate=0.25, reorder=0.25),
        }.items()
    ),
)  # fmt: skip

BOARD = [
    # A frozen board reads its queue when it continues; the newest command in it is STOP.
    Fault("board freeze of 0.5 s", do(Freeze(seconds=0.5)), NEUTRAL, within(0.55)),
    *(
        Fault(f"board restart in {seconds:g} s", do(PowerCycle(seconds=seconds)),
              (*NEUTRAL, *RESET), within(seconds + 0.1))
        for seconds in (0.3, 0.12)
    ),
    Fault("board not heard", do(to_pc(drop=1.0)), NEUTRAL, SILENCE),
    Fault("board answers 0.5 s late", do(to_pc(delay=0.5)), NEUTRAL, SILENCE, hold_s=1.0),
    Fault("board's datagrams from elsewhere", do(to_pc(foreign=1.0)), NEUTRAL, SILENCE),
    # The header has no CRC: an echo with a damaged id can read as a pressed bumper.
    Fault("board's datagrams all damaged", do(to_pc(corrupt=1.0)), (*NEUTRAL, *RESET), SILENCE),
    Fault("board's datagrams twice, out of order", do(to_pc(duplicate=0.5, reorder=0.3)),
          (*ON, *ITSELF, *NEUTRAL)),
    Fault("left driver fault", do(Driver(side="left", bits=1)), RESET, within(0.1)),
    Fault("right driver fault", do(Driver(side="right", bits=1 << 3)), RESET, within(0.1)),
    # The sonars of the direction of travel stop the vehicle; the others do not.
    Fault("front sonar faulty", do(Sonar(name="front", fault=True)), ITSELF, within(0.15)),
    Fault("rear sonar faulty", do(Sonar(name="rear", fault=True)), ON, hold_s=0.8),
    # Suspect after 0.5 m without a change: the speed limit drops.
    Fault("front sonar stuck", do(Sonar(name="front", range=3.0)), ON, hold_s=1.3),
    Fault("rear sonar stuck", do(Sonar(name="rear", range=3.0)), ON, hold_s=0.8),
    # One frame reports all eight.
    Fault("sonars silent", do(Mute(reports=("ultrasonic",))), ITSELF, ULTRASONIC_AGE),
    Fault("bumper silent", do(Mute(reports=("bumper",))), NEUTRAL, BUMPER_AGE),
    Fault("velocity silent", do(Mute(reports=("velocity",))), NEUTRAL, VELOCITY_AGE),
    # The vehicle drives further than the largest accepted step of the counters.
    Fault("mileage silent for 4 s", steps(do(Mute(reports=("mileage",))), pause(4.0), do(Mute())),
          ON, hold_s=4.8),
    # Other firmware behaviour.
    Fault("contact while every third answer is lost",
          steps(do(Mute(reports=("bumper",), every=3)), hit(0.06)), RESET, within(0.02)),
    Fault("contact reported on the other port",
          steps(do(Firmware(hits="second")), hit(0.3)), RESET, within(0.02)),
    # The bridge changes to the other port after 0.1 s without an answer.
    Fault("board answers on the other port", do(Firmware(answers="second")),
          (*ON, *ITSELF, *NEUTRAL)),
    # While safety is dead only the bridge detects that STOP has no effect.
    Fault("safety SIGKILL, the board ignores STOP",
          steps(do(Firmware(ignores=(Command.STOP,))), kill("safety")),
          (*NEUTRAL, *RESET), LEASE_AND_COAST,
          hold_s=2.0, stops=("brake",)),
]  # fmt: skip

GREEDY = [
    Fault("a stranger's 20 000 datagrams/s", injectors.flood, ON, hold_s=1.0),
    Fault("board's 20 000 datagrams/s of garbage", do(Flood(seconds=0.9, garbage=True)),
          (*ON, *NEUTRAL), hold_s=1.0, harmless=True),
    # More than the bridge can publish: answers to its queries are lost, the bumper's first.
    Fault("board's 20 000 datagrams/s of velocities", do(Flood(seconds=0.9)),
          (*ON, *ITSELF, *NEUTRAL), hold_s=1.0, harmless=True),
    Fault("browser's estop while a viewer sends 50 000 messages/s",
          injectors.browser_estop(flooded), RESET,
          within(0.3)),
    Fault("browser's estop while 500 requests do not end",
          injectors.browser_estop(lambda server: half_open(server, 500)), RESET, within(0.3)),
]  # fmt: skip

BUS = [
    *(
        Fault(f"{what} on every key", publish, (*ON, *ITSELF, *NEUTRAL, *RESET), harmless=True)
        for what, publish in injectors.HOSTILE.items()
    ),
    # The vehicle still moves: the lease is 0.2 s.
    Fault("safety hangs, then contact",
          steps(kill("safety", signal.SIGSTOP), pause(0.05), hit(0.3)), RESET, within(0.02)),
    # Twice the lease of a session.
    Fault("safety hangs for 2 s, then estop",
          steps(kill("safety", signal.SIGSTOP), pause(2.0), estop), RESET, within(0.02),
          stops=("brake",)),
    Fault("safety SIGKILL, then estop", steps(kill("safety"), estop), RESET, within(0.02),
          stops=("brake",)),
    # No driver of the campaign requests to back away.
    Fault("safety's authority copied", forged(MOTION, command="run", linear=-0.5), ON,
          harmless=True),
    Fault("safety's number overtaken", forged(MOTION, seq=2**62), ON, harmless=True),
    Fault("bridge's measurements copied",
          steps(forged(BUMPER, pressed=True), forged(VELOCITY, linear=3.0)), ON, harmless=True),
]  # fmt: skip

# The driver is a client of the site's router, to which the robot's router connects.
SITE = needing("site",
    *signals("site router", (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    Fault("site: estop of all", put(ESTOP_OF_ALL), RESET, within(0.05)),
    Fault("site: flood of another robot", injectors.flood_of_another_robot, ON, hold_s=1.5,
          harmless=True),
)  # fmt: skip

RELAY_LEASE = within(0.2 + NOTICE_S)
RELAY = needing("relay",
    Fault("relay: everything on the PC killed", injectors.kill_pc, (*NEUTRAL, *RESET),
          RELAY_LEASE),
    Fault("relay: everything on the PC stopped", injectors.stop_pc, (*NEUTRAL, *RESET),
          RELAY_LEASE),
    Fault("relay: everything on the PC killed in a flood of the board",
          steps(do(Flood(seconds=0.9)), injectors.kill_pc), (*NEUTRAL, *RESET),
          RELAY_LEASE, hold_s=1.0),
    Fault("relay: the PC's cable cut for 0.5 s",
          steps(cable("pc", "down"), pause(0.5), cable("pc", "up")),
          (*NEUTRAL, *RESET), RELAY_LEASE, hold_s=1.0),
    # Here the board holds the last RUN until its cable, or the relay, is back: 0.2 s until the
    # address is resolved, 0.5 s until the program has started.
    Fault("relay: the board's cable cut for 0.5 s",
          steps(cable("board", "down"), pause(0.5), cable("board", "up")),
          (*NEUTRAL, *RESET), within(0.5 + 0.2), hold_s=1.0),
    Fault("relay SIGKILL, started again after 0.3 s",
          steps(kill("relay"), pause(0.3), start_again("relay")),
          (*NEUTRAL, *RESET), within(0.3 + 0.5), hold_s=1.2),
    # The relay's own BRAKE, and one of the bridge that crosses it.
    Fault("relay: contact", hit(0.3), RESET, within(0.02)),
    Fault("relay: estop", estop, RESET, within(0.02)),
    Fault("relay: bridge SIGKILL", kill("bridge"), NEUTRAL, within(0.01)),
)  # fmt: skip

# Groups in sequence, with the number of their parallel stacks. A trial waits most of the time: a
# core can run two stacks, but not while reactions of milliseconds are measured.
GROUPS = (
    (1, [*MILLISECONDS, *GREEDY]),
    (2 * max(2, os.cpu_count() or 2), [*PROCESSES, *NETWORK, *BOARD, *BUS, *SITE, *RELAY]),
)
FAULTS = [fault for _, group in GROUPS for fault in group]
