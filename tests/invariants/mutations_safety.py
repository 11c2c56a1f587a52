"""Mutations of safety: latches, inputs, sonars, source priority and standstill supervision."""

from typing import Any

from common import messages as m
from common.motion import Twist
from common.wire.frame import Side
from services.safety import arbiter, causes, conditions, latches, policy
from services.safety.arbiter import Arbiter
from services.safety.channel import Admission
from services.safety.inputs import Inputs
from services.safety.keepalive import Keepalives
from services.safety.latches import Observation
from services.safety.limits import SpeedLimits
from services.safety.service import SafetyService
from services.safety.sonar_array import SonarOverrides
from services.safety.standstill import Standstill, Supervisor
from services.safety.state import State
from services.safety.zones import Zones
from tests.invariants.mutations import Mutation
from verification.invariants.limits import IGNORED, NEEDED
from verification.invariants.stack import Stack

FAULT_MM = 0xFFFF


def never_stops(stack: Stack) -> None:
    stack.vehicle.measured = Twist(0.28)
    stack.sticks["teleop"].requested = None


def pushed(stack: Stack) -> None:
    stack.sticks["teleop"].requested = None
    stack.run(2500)
    stack.vehicle.measured = Twist(0.28)


def nav_goes_on(stack: Stack) -> None:
    """Overrule nav by teleop, then end teleop's requests."""
    stack.sticks["teleop"].requested, stack.sticks["nav"].requested = None, (0.0, 0.0)
    stack.run(1000)
    stack.sticks["nav"].requested = (0.3, 0.0)
    stack.run(300)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(300)
    stack.sticks["teleop"].requested = None


def goes_on_blind(stack: Stack) -> None:
    """Fail the front sonar while the operator holds the stick."""
    stack.vehicle.ranges[2] = FAULT_MM


def knows_at_once(overrides: SonarOverrides, unseen: Any, _: Any, now_ns: int) -> SonarOverrides:
    return SonarOverrides(dict.fromkeys(unseen, now_ns), {"teleop": frozenset(unseen)})


def estop(stack: Stack) -> None:
    stack.estop()
    stack.run(700)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(700)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def board_freezes(stack: Stack) -> None:
    stack.vehicle.freeze(400)


def wall(stack: Stack) -> None:
    stack.vehicle.ranges[2] = 250


def reset_too_early(stack: Stack) -> None:
    """Reset a driver's fault after its first good sample; they come twice a second."""
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(1500)
    stack.vehicle.fault(Side.LEFT, 1)
    stack.run(20)
    stack.vehicle.fault(Side.LEFT, 0)
    stack.run(600)
    stack.reset()
    stack.run(300)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def driver_blinks(stack: Stack) -> None:
    """Report a driver fault and its end at the same time."""
    for bits in (1, 0):
        stack.vehicle.fault(Side.LEFT, bits)
    stack.vehicle.say(stack.vehicle.board.driver(Side.LEFT))


def at_the_next_tick(ports: SafetyService, field: str, *, at_once: bool = False) -> Any:
    return KEEP(ports, field)


def velocities_fall_silent(stack: Stack) -> None:
    stack.vehicle.reports_velocity = False


def reset_without_a_velocity(stack: Stack) -> None:
    """Stop the velocities at standstill, then reset."""
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(1500)
    stack.estop()
    stack.vehicle.reports_velocity = False
    stack.run(1000)
    stack.reset()
    stack.vehicle.reports_velocity = True
    stack.run(1000)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def however_old(inputs: Inputs, *_: object) -> Twist | None:
    return inputs.measured


def limit(stack: Stack) -> None:
    stack.limiters[IGNORED].caps = (0.2, None)


def protective_stop(stack: Stack) -> None:
    """Stop the vehicle, and lift the stop while the stick is pushed."""
    stack.limiters[IGNORED].caps = (0.0, None)
    stack.run(1500)
    stack.limiters[IGNORED].caps = (None, None)


def limit_falls_silent(stack: Stack) -> None:
    stack.limiters[NEEDED].caps = None


def rival_limit(stack: Stack) -> None:
    limiter = stack.limiters[NEEDED]
    limiter.put(m.Limit(linear=9.0, echo=limiter.echo, boot=5))


def pendant_falls_silent(stack: Stack) -> None:
    stack.pendant.alive = False


def pendant_is_held(stack: Stack) -> None:
    """Deliver a sign of life almost too late, then none."""
    echo = stack.pendant.echo
    stack.pendant.alive = False
    stack.run(850)
    stack.pendant.put(m.EstopKeepalive(echo=echo))


def router_blinks(stack: Stack) -> None:
    """Lose the router and find it again between two decisions; then drive on."""
    stack.router(False)
    stack.router(True)
    drives_on(stack)


def safety_stalls(stack: Stack) -> None:
    """Stall for longer than any session lasts; reset what a pendant has latched, and drive on."""
    stack.stall("safety", 1500)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(2500)
    assert stack.reset()
    drives_on(stack)


def drives_on(stack: Stack) -> None:
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(1500)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def program_is_suspended(stack: Stack) -> None:
    """Silence a source for longer than its lease and a second; then it drives on."""
    stack.sticks["teleop"].requested = None
    stack.run(1500)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def only_if_down(inputs: Inputs, state: State, now_ns: int) -> Observation:
    lost = state.estop_connection > 0 and not inputs.estop_connection
    return Observation("estop_reader", lost, (0, now_ns))


KEEP = SafetyService._store

SAFETY_MUTATIONS: dict[str, Mutation] = {
    "latches clear by time": (
        latches, "_is_over", lambda *_: True, estop, "safety knows of estop",
    ),
    "no neutral after a return": (
        Arbiter, "disarmed", lambda self: self, board_freezes, "was not neutral",
    ),
    "a reset clears what is not gone": (
        latches, "GOOD_SAMPLES", 0, reset_too_early, "safety knows of driver",
    ),
    "no input is too old": (
        conditions, "_is_old", lambda *_: False, velocities_fall_silent, "old velocity",
    ),
    "an old velocity is as good as a new one": (
        Inputs, "known_velocity", however_old, reset_without_a_velocity, "safety knows of estop",
    ),
    "samples are not decided upon one by one": (
        SafetyService, "_store", at_the_next_tick, driver_blinks, "safety knows of driver",
    ),
    "the margin is ignored": (
        Zones, "allowed", lambda *_: 1.0, wall, "toward sonar 2",
    ),
    "a stop is not supervised": (
        Standstill, "is_late", lambda *_: False, never_stops, "no BRAKE while",
    ),
    "a standstill is not supervised": (
        Supervisor, "_stay", lambda self, standstill, *_: standstill, pushed, "no BRAKE while",
    ),
    "a limit does not slow": (
        SpeedLimits, "limited", lambda _, twist, __: (twist, None), limit, "faster than a limit",
    ),
    "a protective stop does not stop": (
        SpeedLimits, "observations", lambda *_: iter(()), protective_stop,
        "protective stop of fleet",
    ),
    "a protective stop wants no neutral": (
        policy, "wants_neutral", lambda name: name != "limit_stop" and causes.wants_neutral(name),
        protective_stop, "was not neutral",
    ),
    "a silent limit source drives on": (
        SpeedLimits, "_silent", lambda *_: [], limit_falls_silent, "no limit of lidar",
    ),
    "two publishers of a limit": (
        SpeedLimits, "_in_conflict", lambda *_: [], rival_limit, "two publishers of one limit",
    ),
    "a pendant that fell silent does not latch": (
        Keepalives, "observation", lambda *_: Observation("estop_keepalive", False, (0, 0)),
        pendant_falls_silent, "safety knows of estop_keepalive",
    ),
    "a held sign of life counts from its reception": (
        Admission, "sent_ns", lambda self, _: self.now_ns, pendant_is_held,
        "safety knows of estop_keepalive",
    ),
    "a connection that was lost in between does not latch": (
        conditions, "_estop_reader", only_if_down, router_blinks, "safety knows of estop_reader",
    ),
    "a stall of safety does not latch": (
        conditions, "_estop_reader", only_if_down, safety_stalls, "safety knows of estop_reader",
    ),
    "a suspended program drives on": (
        arbiter, "LAPSE_S", 1e9, program_is_suspended, "was not neutral",
    ),
    "an override does not hold": (
        Arbiter, "overruled", lambda self, _: self, nav_goes_on, "nav was not neutral",
    ),
    "a hold that was meant for a good sonar drives on blind": (
        SonarOverrides, "updated", knows_at_once, goes_on_blind, "toward sonar 2",
    ),
}  # fmt: skip
