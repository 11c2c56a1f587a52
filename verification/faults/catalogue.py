"""The catalogue of faults, with the reaction that ``docs/safety.md`` allows for each.

A row is here when only real processes can show it. What a message contains, or the order of events,
is shown by the tests of the cores and by the search.
"""

import os
import signal
from dataclasses import replace
from functools import partial

from zenoh import CongestionControl

from cli.settings import Everything, safety_config
from services.bridge.config import BridgeConfig, TimeLimits
from sim.requests import Driver, Firmware, Flood, Freeze, Mute, PowerCycle, Sonar, Wire
from t2.messages import Command
from verification.faults import injectors
from verification.faults.fault import NOTICE_S, Fault, Outcome, by_limit, within
from verification.faults.independent_client import BUMPER, MOTION, VELOCITY, Client
from verification.faults.injectors import (
    ESTOP,
    board_line,
    cable_to_pc,
    do,
    estop,
    forged,
    hit,
    kill,
    late_calls,
    meanwhile,
    network,
    pause,
    press,
    put,
    request,
    steps,
)
from verification.faults.stack_fixture import LIMIT_LEASE_S, PENDANT_LEASE_S, Requirement


def bridge(config: Everything) -> TimeLimits:
    """Return the time limits of the bridge on this host."""
    return BridgeConfig(host=config.host).times


ON: tuple[Outcome, ...] = ("drives on",)
ITSELF: tuple[Outcome, ...] = ("by itself",)
NEUTRAL: tuple[Outcome, ...] = ("after a neutral",)
RESET: tuple[Outcome, ...] = ("after a reset",)

MOTION_LEASE = by_limit(lambda config: bridge(config).lease)
LEASE_AND_COAST = by_limit(lambda config: bridge(config).lease + bridge(config).coast)
HEARTBEAT = by_limit(lambda config: bridge(config).pulse)
SILENCE = by_limit(lambda config: bridge(config).silence)
BUMPER_AGE = by_limit(lambda config: safety_config(config).times.bumper_age)
VELOCITY_AGE = by_limit(lambda config: safety_config(config).times.velocity_age)
ULTRASONIC_AGE = by_limit(lambda config: safety_config(config).times.ultrasonic_age)
REQUEST_LEASE = by_limit(lambda config: safety_config(config).leased["teleop"].lease)
KEEPALIVE = by_limit(lambda _: PENDANT_LEASE_S)
LIMIT_LEASE = within(LIMIT_LEASE_S + NOTICE_S)


def needing(need: Requirement, *faults: Fault) -> list[Fault]:
    """Return the faults with a requirement."""
    return [replace(fault, needs=need) for fault in faults]


to_pc = partial(Wire, direction="to_pc")

MILLISECONDS = [
    Fault("contact", hit(0.3), RESET, within(0.02)),
    Fault("contact in one sample", hit(0.0), RESET, within(0.02)),
    Fault("estop", estop, RESET, within(0.02)),
    Fault("bridge SIGKILL", kill("bridge"), NEUTRAL, within(0.01)),
    *needing("separate clocks",
        Fault("robot's clock stepped by +1 h", injectors.step_time_of_day("robot", 3600), ON,
              hold_s=1.5),
        Fault("driver's clock stepped by -1 h", injectors.step_time_of_day("driver", -3600), ON,
              hold_s=1.5),
    ),
]  # fmt: skip

PROCESSES = [
    Fault("bridge SIGSTOP", kill("bridge", signal.SIGSTOP), NEUTRAL, HEARTBEAT),
    Fault("guard SIGKILL", kill("guard"), NEUTRAL, within(0.05)),
    # A safety that was stopped could not receive an emergency stop; its latches outlive it.
    Fault("safety SIGKILL", kill("safety"), (*NEUTRAL, *RESET), MOTION_LEASE),
    Fault("safety SIGSTOP", kill("safety", signal.SIGSTOP), (*NEUTRAL, *RESET), MOTION_LEASE),
    # While safety is dead only the bridge detects that STOP has no effect.
    Fault("safety SIGKILL, the board ignores STOP",
          steps(do(Firmware(ignores=(Command.STOP,))), kill("safety")),
          (*NEUTRAL, *RESET), LEASE_AND_COAST,
          hold_s=2.0, stops=("brake",)),
    # Without the bus safety cannot receive an emergency stop: it latches that.
    Fault("router SIGKILL", kill("router"), (*NEUTRAL, *RESET), MOTION_LEASE),
    Fault("router SIGSTOP", kill("router", signal.SIGSTOP), (*NEUTRAL, *RESET), MOTION_LEASE),
    Fault("router gone for 5 s", kill("router"), RESET, MOTION_LEASE, hold_s=5.0,
          stops=("brake",)),
    # A continued driver still requests motion: its next request counts.
    Fault("driver SIGKILL", kill("driver"), (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    Fault("driver SIGSTOP", kill("driver", signal.SIGSTOP), (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    Fault("odom SIGKILL", kill("odom"), ON),
    # Its silence stops the vehicle, by the settings of this stack.
    *needing("third parties",
        Fault("limit source SIGKILL, silence = stop", kill("limiter"), NEUTRAL, LIMIT_LEASE),
        Fault("pendant SIGKILL", kill("pendant"), RESET, KEEPALIVE, hold_s=1.5),
    ),
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
    # The stick was released meanwhile: no earlier request may move the vehicle any more.
    Fault("driver's network cut for 3 s, then the burst",
          steps(network(Wire(drop=1.0)), pause(0.4), request(0.0), pause(2.6), network(Wire())),
          NEUTRAL, REQUEST_LEASE, hold_s=4.0),
    Fault("all from the driver 1 s late", network(to_pc(delay=1.0)), (*ITSELF, *NEUTRAL),
          REQUEST_LEASE, hold_s=2.0),
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
    Fault("left driver fault", do(Driver(side="left", bits=1)), RESET, within(0.1)),
    Fault("front sonar faulty", do(Sonar(name="front", fault=True)), ITSELF, within(0.15)),
    # Suspect after 0.5 m without a change: the speed limit drops.
    Fault("front sonar stuck", do(Sonar(name="front", range=3.0)), ON, hold_s=1.3),
    # One frame reports all eight.
    Fault("sonars silent", do(Mute(reports=("ultrasonic",))), ITSELF, ULTRASONIC_AGE),
    Fault("bumper silent", do(Mute(reports=("bumper",))), NEUTRAL, BUMPER_AGE),
    Fault("velocity silent", do(Mute(reports=("velocity",))), NEUTRAL, VELOCITY_AGE),
    # Other firmware behaviour.
    Fault("contact while every third answer is lost",
          steps(do(Mute(reports=("bumper",), every=3)), hit(0.06)), RESET, within(0.02)),
    Fault("contact reported on the other port",
          steps(do(Firmware(hits="second")), hit(0.3)), RESET, within(0.02)),
    # The bridge changes to the other port after 0.1 s without an answer.
    Fault("board answers on the other port", do(Firmware(answers="second")),
          (*ON, *ITSELF, *NEUTRAL)),
]  # fmt: skip

GREEDY = [
    Fault("a stranger's 20 000 datagrams/s", injectors.flood, ON, hold_s=1.0),
    # The guard may run on another CPU. It kills the bridge, and brakes until the next one drives.
    Fault("the CPU of bridge and safety taken for 0.9 s", injectors.take_cpu, (*NEUTRAL, *RESET),
          HEARTBEAT, hold_s=1.5, stops=("brake",)),
    # More than the bridge can publish: answers to its queries are lost, the bumper's first.
    Fault("board's 20 000 datagrams/s of velocities", do(Flood(seconds=0.9)),
          (*ON, *ITSELF, *NEUTRAL), hold_s=1.0, harmless=True),
    # What a parser resumes at most often; each costs one step, and the reflex is not delayed.
    Fault("board's 300 datagrams/s of GS, then contact",
          steps(do(Flood(seconds=1.3, rate=300, datagram=b"GS" * 1024)), pause(0.7), hit(0.3)),
          RESET, within(0.02), harmless=True),
    Fault("queries as fast as possible", injectors.query_flood, ON, hold_s=3.0),
    Fault("queries as fast as possible, then contact",
          steps(injectors.query_flood, pause(1.0), hit(0.3)), RESET, within(0.02)),
    Fault("requests as fast as possible, then estop",
          steps(injectors.request_flood, pause(1.0), estop), RESET, within(0.02)),
    # The table is full after some 5 s; the probe must not take that for a hang.
    Fault("a viewer's sessions until the router refuses more", injectors.session_flood, ON,
          hold_s=15.0, harmless=True),
    Fault("browser's estop in floods of messages and events", injectors.browser_estop,
          RESET, within(0.3)),
]  # fmt: skip

BUS = [
    *(
        Fault(f"{what} on every key", publish, (*ON, *ITSELF, *NEUTRAL, *RESET), harmless=True)
        for what, publish in injectors.HOSTILE.items()
    ),
    # With Zenoh's default congestion control (drop) the sender drops a message of this size.
    Fault("estop with 1 MB in it",
          put(ESTOP, b"x" * 1_000_000, congestion_control=CongestionControl.BLOCK),
          RESET, within(0.1)),
    # The vehicle still moves: the lease is 0.2 s.
    Fault("safety hangs, then contact",
          steps(kill("safety", signal.SIGSTOP), pause(0.05), hit(0.3)), RESET, within(0.02)),
    # The lease of a session is 1 s.
    *(
        Fault(f"safety hangs for {seconds:g} s, estop meanwhile",
              steps(kill("safety", signal.SIGSTOP), meanwhile(seconds, estop)), RESET,
              within(0.02), stops=("brake",), hold_s=0.1)
        for seconds in (0.5, 2.0, 10.0, 45.0)
    ),
    Fault("router restarts, estop repeated for 3 s",
          steps(kill("router"), injectors.restart, injectors.repeated_estop(3.0)), RESET,
          MOTION_LEASE),
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
    Fault("site router SIGKILL", kill("site router"), (*NEUTRAL, *ITSELF), REQUEST_LEASE),
    Fault("site: estop of all", put("t2/v1/*/estop"), RESET, within(0.05)),
    Fault("site: flood of another robot", injectors.flood_of_another_robot, ON, hold_s=1.5,
          harmless=True),
)  # fmt: skip

RELAY_LEASE = within(0.2 + NOTICE_S)
RELAY = needing("relay",
    Fault("relay: everything on the PC killed", injectors.kill_pc, (*NEUTRAL, *RESET),
          RELAY_LEASE),
    Fault("relay: the PC's cable cut for 0.5 s",
          steps(cable_to_pc("down"), pause(0.5), cable_to_pc("up")),
          (*NEUTRAL, *RESET), RELAY_LEASE, hold_s=1.0),
    # The relay's own BRAKE, and one of the bridge that crosses it.
    Fault("relay: contact", hit(0.3), RESET, within(0.02)),
    Fault("relay: estop", estop, RESET, within(0.02)),
)  # fmt: skip

INDEPENDENT_BOARD = needing("independent board",
    Fault("independent board: contact 0x80 on the second port", board_line(b"press 128 1"),
          RESET, within(0.1)),
    # Driven into it, the bumper would latch.
    Fault("independent board: a wall 2 m ahead", board_line(b"wall 2"), ITSELF, hold_s=9.0),
    # 0.05 m at 0.1 m/s, the way to this speed, and the reaction.
    Fault("independent board: rolls away, safety killed",
          steps(request(0.0), pause(1.5), kill("safety"), pause(1.5), board_line(b"roll 0.1")),
          (*NEUTRAL, *RESET), within(0.9), hold_s=1.5, stops=("brake",)),
)  # fmt: skip

# Groups in sequence, with the number of their parallel stacks. A trial waits most of the time: a
# core can run two stacks, but not while reactions of milliseconds are measured.
GROUPS = (
    (1, [*MILLISECONDS, *GREEDY]),
    (
        2 * max(2, os.cpu_count() or 2),
        [*PROCESSES, *NETWORK, *BOARD, *BUS, *SITE, *RELAY, *INDEPENDENT_BOARD],
    ),
)
FAULTS = [fault for _, group in GROUPS for fault in group]
