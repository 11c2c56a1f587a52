"""Mutations: each removes one protection; the oracle must object to its scenario.

Most change a setting, or what a service receives. The others replace a part of a core.
"""

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from msgspec.structs import replace

from common import heartbeat
from common.bus.bus import Arrival
from common.freshness import NS_PER_S
from common.standstill import Displacement
from common.wire import framing
from common.wire.frame import Frame, Side
from common.wire.reports import BumperBrakeReport, BumperReport
from services.bridge.config import BridgeConfig
from services.bridge.core import lease as leases
from services.bridge.core.lease import Lease
from services.ros2 import command
from services.safety.config import LimitSource, Safety, SafetyConfig
from services.safety.core import arbiter, causes, conditions, planning, release_requests
from services.safety.core.arbiter import Arbiter
from services.safety.core.causes import Held, Observation
from services.safety.core.inputs import Inputs
from services.safety.core.motion_watch import Standstill
from services.safety.core.release import Release
from services.safety.core.sonars import SonarOverrides
from services.safety.core.state import State
from services.safety.service import SafetyService
from sim import requests as q
from t2 import keys
from t2 import messages as m
from t2.messages import Command
from tests.search.scripted_stack import FAULT_MM
from tests.search.scripted_stack import ScriptedStack as Stack
from verification.search import bus
from verification.search.bus import ROBOT, Disturbance, DriveEnd, Envelope, Process
from verification.search.condition_books import IGNORED, LEASE_S, NEEDED, PENDANT
from verification.search.stack import CONFIGS, Sockets

Script = tuple[Callable[[Stack], object], ...]
Patch = tuple[Any, str, object]  # owner, attribute (or key of a dict) and its replacement
Mutation = tuple[Patch, Script, str]  # what removes a protection; a scenario; the objection to it

# --- scenarios: what happens to a vehicle that drives at 0.5 m/s ----------------------------------

LET_GO: Script = (lambda s: s.request(None, 1500),)
STAND: Script = (lambda s: s.request(0.0, 1500),)
GO: Script = (lambda s: s.request(0.5),)
GO_ON = (*STAND, *GO)
HIT: Script = (lambda s: s.press(True, 1500),)
STUCK: Script = (lambda s: s.request(None), *HIT)
LATE_MOTIONS: Script = (lambda s: s.disturb("motion", Disturbance(late_ms=60), 300),)
# Later by 40 ms at a time: a longer gap between samples of the bumper would stop the vehicle.
LATE_STREAMS: Script = tuple(
    partial(Stack.disturb, route="streams", disturbance=Disturbance(late_ms=late_ms), ms=100)
    for late_ms in (40, 80, 120, 160, 200)
)
RESET: Script = (lambda s: s.reset(), lambda s: s.run(300))
PROTECTIVE_STOP: Script = (
    lambda s: s.limit(0.0, 1500, source=IGNORED),
    lambda s: s.limit(None, source=IGNORED),  # while the stick is pushed
)
FRONT, LEFT = range(2, 3), range(1)
CRAWL: Script = (lambda s: s.request(0.05, 1500),)


def brakes_go_off_and_on(stack: Stack) -> None:
    """Report to safety too late that the board's brake was off."""
    for on in (False, True):
        stack.send(framing.pack(BumperBrakeReport(on)))
        stack.run(60)


def tap_in_a_gap(stack: Stack) -> None:
    """Press the bumper for 60 ms while its samples are lost."""
    stack.vehicle.inject(q.Mute(reports=("bumper",)))
    stack.tap(60)
    stack.run(80)
    stack.vehicle.inject(q.Mute())


def successor(
    stack: Stack, deliver: Callable[[Callable[[Envelope], None], Envelope], None]
) -> None:
    """Kill safety with a latched emergency stop; ``deliver`` passes the link to its successor."""
    stack.stop(100)
    stack.kill("safety", 20)
    stack.run(25)
    of_safety = [one for one in stack.net.subscriptions if one.owner is stack.processes["safety"]]
    (link,) = [one for one in of_safety if one.key == keys.LINK.on(ROBOT)]
    link.take = partial(deliver, link.take)


def successor_hits_something(stack: Stack) -> None:
    """Latch a contact in the successor before it receives the link, then release."""
    deaf_until_ns = stack.net.now_ns + NS_PER_S

    def late(take: Callable[[Envelope], None], envelope: Envelope) -> None:
        if stack.net.now_ns > deaf_until_ns:
            take(envelope)

    successor(stack, late)
    stack.measure(0.2, 40)  # still, so that a way off is known
    stack.measure(None)
    stack.request(None)
    stack.press(True, 2500)
    stack.creep()


def successor_hears_of_no_latch(stack: Stack) -> None:
    """Deliver to the successor a link sample from before the latch."""

    def old(take: Callable[[Envelope], None], envelope: Envelope) -> None:
        assert isinstance(envelope.message, m.Link)
        message = replace(envelope.message, latched_by=None, armed=True)
        take(dataclasses.replace(envelope, message=message))

    successor(stack, old)


def without(seen: m.SafetyState | None, cause: str) -> m.SafetyState:
    """Return a state without a cause."""
    assert seen is not None
    return replace(seen, causes=tuple(one for one in seen.causes if one.name != cause))


SAFETY_HANGS: Script = (
    lambda s: s.stall("safety", 1500),
    lambda s: s.run(700),
    lambda s: s.stop(1500),
    lambda s: s.request(0.0, 700),
    lambda s: s.reset(without(s.seen, "estop")),
    lambda s: s.run(300),
    *GO,
)


def authority_is_copied(stack: Stack) -> None:
    copy = m.Motion(command=Command.RUN, linear=0.9, seq=2**19, boot=stack.processes["safety"].boot)
    stack.forge(keys.MOTION, copy)


def late_releases(stack: Stack) -> None:
    echo = stack.sources["teleop"].echo
    stack.run(2000)
    stack.put_release("none", echo)
    for _ in range(20):
        stack.put_release("backward", echo)
        stack.run(5)


def held_before(stack: Stack) -> None:
    """Hold the release before the bumper is pressed, and go on holding it."""
    stack.request(0.0, 1500)
    stack.hold("backward", 300)
    stack.press(True, 1500)


def program_releases(stack: Stack) -> None:
    stack.request(0.0, 300, source="nav")
    stack.hold("backward", 600, source="nav")


def pressed_again_and_again(stack: Stack) -> None:
    """Free the bumper repeatedly at standstill, and use the whole distance of each release."""
    for _ in range(4):
        stack.creep()
        stack.run(1500)
        stack.press(False, 300)
        stack.press(True, 300)


def pressed_again_in_a_stall(stack: Stack) -> None:
    """Press the bumper twice during a release; safety stalls while it is free in between."""
    stack.request(0.0, 60)
    stack.hold("backward", 250)
    stack.press(False, 40)
    stack.stall("safety", 45)
    stack.run(25)
    stack.press(True, 400)


def reset_of_what_was_seen(stack: Stack) -> None:
    """Reset an emergency stop as it was seen before a contact that came meanwhile."""
    stack.stop(100)
    seen = stack.seen
    stack.press(True, 60)
    stack.press(False, 400)
    stack.reset(seen)
    stack.run(300)


def late_reset(stack: Stack) -> None:
    """Reset three seconds after what the operator saw; the bumper was touched meanwhile."""
    for _ in range(2):
        stack.press(True, 60)
        seen = stack.seen
        stack.press(False, 40)
    stack.run(3000)
    stack.reset(seen)
    stack.run(300)


def driver_blinks(stack: Stack) -> None:
    """Report a driver fault and its end at the same time."""
    stack.driver(1)
    stack.driver(0)
    stack.send(framing.pack(stack.board.driver(Side.LEFT)))


def rival_limit(stack: Stack) -> None:
    limiter = stack.sources[NEEDED]
    limiter.put(m.Limit(linear=9.0, echo=limiter.echo, boot=5))


def pendant_is_held(stack: Stack) -> None:
    """Deliver a sign of life almost too late, then none."""
    pendant = stack.sources[PENDANT]
    echo = pendant.echo
    stack.silence(PENDANT, 850)
    pendant.put(m.Limit(echo=echo))


def reset_is_granted(stack: Stack) -> None:
    assert stack.reset().done


# --- what removes a protection --------------------------------------------------------------------


def configured(service: str, **settings: Any) -> Patch:
    """Change settings of a service."""
    config: Any = CONFIGS[service]
    section = getattr(config, service)
    changed = replace(section, **settings)
    return CONFIGS, service, replace(config, **{service: changed})


def timed(root: type[BridgeConfig | SafetyConfig], **limits: float) -> Patch:
    """Change time limits of a service."""
    return root, "times", replace(root().times, **limits)


def received(kind: type[m.Message], change: Callable[[Any], m.Message]) -> Patch:
    """Change each message of a kind on its way from the oracle to its receiver."""

    def arrive(message: Any, *rest: Any) -> Arrival[Any]:
        return Arrival(change(message) if isinstance(message, kind) else message, *rest)

    return bus, "Arrival", arrive


def reported(frame: Frame, instead: Frame) -> Patch:
    """Replace a frame of the board on its way from the oracle to the bridge."""
    read, replaced = Sockets.read, framing.pack(frame)

    def misread(sockets: Sockets, *ports: int) -> Iterator[tuple[Any, ...]]:
        for port, datagram, *rest in read(sockets, *ports):
            yield port, framing.pack(instead) if datagram == replaced else datagram, *rest

    return Sockets, "read", misread


def always_connected(process: Process) -> int:
    """Return the first connection to the router while there is any."""
    return int(process.net.up)


def from_anybody(link: DriveEnd, topic: keys.Topic[Any], handler: Any, **names: Any) -> None:
    """Subscribe on the router as well."""
    link._process.subscribe(topic, handler, **names)


ON_ANY = Process.on_any


def deaf_bridge(process: Process, key: str, handler: Callable[[int], None]) -> None:
    """Subscribe to emergency stops; the bridge ignores them."""
    ON_ANY(process, key, handler if process.name != "bridge" else lambda _: None)


def newest_echo() -> Callable[[Any], Any]:
    """Return a change that gives a sign of life the newest heartbeat as its echo."""
    beats = [0]

    def change(message: Any) -> Any:
        if isinstance(message, m.SafetyState):
            beats[0] = message.heartbeat
        return replace(message, echo=beats[0]) if isinstance(message, m.Limit) else message

    return change


FIRST_SAFETY = Stack().processes["safety"].boot
SILENT = LimitSource(lease=LEASE_S, silence="ignore")
SAFETY: Any = CONFIGS["safety"]
LIMITS: dict[str, LimitSource] = SAFETY.safety.limits
ON_MOTION, EXPIRE = leases.on_motion, leases.expire
AFTER, ON_BUMPER, ZONES = Release.after, SafetyService._on_bumper, planning.zones


def never(*_: Any) -> bool:
    return False


def unchanged(first: Any, *_: Any) -> Any:
    return first


def still_armed(lease: Lease, ready: bool) -> Lease:
    return replace(lease, ready=ready)


def still_neutral(lease: Lease, now_ns: int, lease_ns: int) -> Lease:
    return replace(EXPIRE(lease, now_ns, lease_ns), neutral=lease.neutral)


def whoever(lease: Lease, *rest: Any, **more: Any) -> Any:
    return ON_MOTION(replace(lease, latched_by=None), *rest, **more)


def unacknowledged(lease: Lease, received_ns: int) -> tuple[Lease, Command]:
    return replace(lease, sent_ns=received_ns), Command.BRAKE


def unforgetting(release: Release, old: Held | None, contact: Held, *rest: Any) -> Release:
    """Update a release, but forget earlier presses at each new press."""
    anew = contact.good == 0 and old is not None and old.good > 0
    return AFTER(Release() if anew else release, None if anew else old, contact, *rest)


def only_hits(service: SafetyService, arrival: Any) -> None:
    """Decide on hits, and take a clear sample without a decision."""
    if arrival.message.pressed:
        ON_BUMPER(service, arrival)
    else:
        service._store("bumper")(arrival)


def knows_at_once(overrides: SonarOverrides, unseen: Any, _: Any, now_ns: int) -> SonarOverrides:
    return SonarOverrides(dict.fromkeys(unseen, now_ns), {"teleop": frozenset(unseen)})


def turning_stops_at_once(settings: SafetyConfig) -> planning.Zones:
    return replace(ZONES(settings), angular_deceleration=1e3)


def only_if_down(inputs: Inputs, state: State, _: int) -> Observation | None:
    lost = state.estop_connection > 0 and not inputs.estop_connection
    return Observation("estop_reader") if lost else None


# --- the table ------------------------------------------------------------------------------------

MUTATIONS: dict[str, Mutation] = {
    "the bridge's lease never ends": (
        timed(BridgeConfig, lease=10.0), (lambda s: s.kill("safety", 5000),), "a RUN is held",
    ),
    "a new bridge waits too short for safety": (
        (leases, "BEGIN_NS", NS_PER_S // 10),
        (lambda s: s.kill("bridge", 200), lambda s: s.stall("safety", 700)),
        "replaced the guard's BRAKE",
    ),
    "no neutral after a lease": (
        (leases, "expire", still_neutral),
        (*LATE_STREAMS, lambda s: s.disturb("motion", Disturbance(lose=1), 250),
         lambda s: s.net.disturbances.pop("motion")), "no neutral motion came",
    ),
    "silence is not noticed": (
        timed(BridgeConfig, silence=10.0), (*LATE_STREAMS, lambda s: s.freeze(280)),
        "the board is silent",
    ),
    "brakes that are off": (
        reported(BumperBrakeReport(False), BumperBrakeReport(True)),
        (*LATE_STREAMS, brakes_go_off_and_on), "its brakes are not both on",
    ),
    "no neutral after brakes that were off": (
        (leases, "on_ready", still_armed), (*LATE_STREAMS, brakes_go_off_and_on),
        "no neutral motion came",
    ),
    "the bridge remembers no latch": (
        received(m.Motion, lambda motion: replace(motion, latched=False)),
        (lambda s: s.stop(100), lambda s: s.kill("safety", 20), lambda s: s.run(1500),
         lambda s: s.request(0.0, 700), *GO), "bridge knows of estop",
    ),
    "a successor's own latch hides the one that is due": (
        received(m.Motion, lambda motion: replace(motion, predecessor=FIRST_SAFETY)),
        (successor_hits_something,), "safety knows of estop",
    ),
    "a successor need not know of the latch": (
        (leases, "on_motion", whoever), (successor_hears_of_no_latch, *GO_ON),
        "bridge knows of estop",
    ),
    "the age of the bumper's samples does not matter": (
        (conditions, "_bumper", lambda *_: None), (tap_in_a_gap,),
        "a press of 60 ms was missed",
    ),
    "a hit needs no judgement": (
        received(m.Motion, lambda motion: replace(motion, judged=2**62)),
        (*LATE_MOTIONS, *HIT), "bridge knows of contact",
    ),
    "an emergency stop needs no acknowledgement": (
        (leases, "on_estop", unacknowledged), SAFETY_HANGS, "bridge knows of estop",
    ),
    "the bridge does not brake for an emergency stop": (
        (Process, "on_any", deaf_bridge), SAFETY_HANGS, "without a BRAKE",
    ),
    "the drive link takes messages of the router": (
        (DriveEnd, "subscribe", from_anybody), (authority_is_copied,), "a RUN that no safety sent",
    ),
    "the reflex does not brake": (
        reported(BumperReport(True), BumperReport(False)), (*LATE_MOTIONS, *HIT),
        "without a BRAKE",
    ),
    "late releases are obeyed": (
        timed(SafetyConfig, max_echo_age=10.0), (*STUCK, late_releases), "no fresh request",
    ),
    "a release needs no neutral request": (
        (release_requests, "_not_let_go", lambda *_: ""), (held_before,), "was not neutral",
    ),
    "a program may release": (
        (Safety, "operators", frozenset({"teleop", "nav"})), (*STUCK, program_releases),
        "no operator's source",
    ),
    "a late reset is obeyed": (
        (heartbeat, "MAX_CALL_AGE_NS", 10 * NS_PER_S), (*STAND, late_reset, *GO),
        "safety knows of contact",
    ),
    "a reset clears what it does not name": (
        (causes, "named", lambda held, _: causes.latched(held)),
        (*STAND, reset_of_what_was_seen, *GO), "safety knows of contact",
    ),
    "each press has its full distance again": (
        (Release, "after", unforgetting), (*STUCK, pressed_again_and_again), "farther than its way",
    ),
    "no direction is forbidden": (
        (Release, "after", unforgetting),
        (*STUCK, lambda s: s.creep(), lambda s: s.press(False, 150), lambda s: s.press(True, 700),
         lambda s: s.creep()), "in which the bumper was pressed",
    ),
    "latches clear by time": (
        (causes, "_is_over", lambda *_: True),
        (lambda s: s.stop(700), lambda s: s.request(0.0, 700), *GO), "safety knows of estop",
    ),
    "no neutral after a return": (
        (Arbiter, "barred", unchanged), (lambda s: s.freeze(400),), "was not neutral",
    ),
    "a neutral request from before a reset counts": (
        (Arbiter, "barred", lambda arbiter, now_ns: replace(arbiter, barred_ns=now_ns - NS_PER_S)),
        (*STAND, lambda s: s.stop(700), lambda s: s.reset(), *GO), "was not neutral",
    ),
    "a reset clears what is not gone": (
        (causes, "GOOD_SAMPLES", 0),
        (*STAND, lambda s: s.driver(1, 20), lambda s: s.driver(0, 600), *RESET, *GO),
        "safety knows of driver",
    ),
    "no input is too old": (
        timed(SafetyConfig, velocity_age=10.0), (lambda s: s.velocities(False),), "old velocity",
    ),
    "an old velocity is as good as a new one": (
        timed(SafetyConfig, velocity_age=10.0),
        (*STAND, lambda s: s.estop(), lambda s: s.velocities(False, 1000), *RESET,
         lambda s: s.velocities(True, 1000), *GO),
        "safety knows of estop",
    ),
    "a bumper that is free again is not decided on at once": (
        (SafetyService, "_on_bumper", only_hits), (*STUCK, pressed_again_in_a_stall),
        "in which the bumper was pressed",
    ),
    "driver faults are not decided on at once": (
        (SafetyService, "_store_driver", SafetyService._store), (driver_blinks,),
        "safety knows of driver",
    ),
    "a source drives on from a standstill": (
        (Arbiter, "at_rest", unchanged),
        (*CRAWL, lambda s: s.silence("teleop", 900), *CRAWL), "was not neutral",
    ),
    "a turn is judged as if it stopped at once": (
        (planning, "zones", turning_stops_at_once),
        (lambda s: s.request(0.0, 400), lambda s: s.sonars(600, numbers=LEFT),
         lambda s: s.request(0.0, 1500, angular=1.0)), "toward sonar 0",
    ),
    "the margin is ignored": (
        configured("safety", margin=0.0), (lambda s: s.sonars(250, numbers=FRONT),),
        "toward sonar 2",
    ),
    "a stop is not supervised": (
        (Standstill, "is_late", never), (lambda s: s.measure(0.28), lambda s: s.request(None)),
        "no BRAKE while",
    ),
    "a standstill is not supervised": (
        (Displacement, "has_left", property(never)),
        (lambda s: s.request(None, 2500), lambda s: s.measure(0.28)), "no BRAKE while",
    ),
    "a limit does not slow": (
        received(m.Limit, lambda limit: replace(limit, linear=None)),
        (lambda s: s.limit(0.2, source=IGNORED),), "faster than a limit",
    ),
    "a protective stop does not stop": (
        received(m.Limit, lambda it: replace(it, linear=0.05 if it.linear == 0 else it.linear)),
        PROTECTIVE_STOP, "protective stop of detector",
    ),
    "a protective stop wants no neutral": (
        (Arbiter, "barred", unchanged), PROTECTIVE_STOP, "was not neutral",
    ),
    "a silent limit source drives on": (
        configured("safety", limits={**LIMITS, NEEDED: SILENT}),
        (lambda s: s.silence(NEEDED),), "no limit of lidar",
    ),
    "two publishers of a limit": (
        received(m.Limit, lambda limit: replace(limit, boot=1)), (rival_limit,),
        "two publishers of one limit",
    ),
    "a pendant that fell silent does not latch": (
        configured("safety", limits={**LIMITS, PENDANT: LimitSource(lease=10.0, silence="latch")}),
        (lambda s: s.silence(PENDANT),), "safety knows of estop_keepalive",
    ),
    "a held sign of life counts from its reception": (
        received(m.Message, newest_echo()), (pendant_is_held,),
        "safety knows of estop_keepalive",
    ),
    "a connection that was lost in between does not latch": (
        (Process, "connection", property(always_connected)),
        (lambda s: s.router(False), lambda s: s.router(True), *GO_ON),
        "safety knows of estop_reader",
    ),
    "a stall of safety does not latch": (
        (conditions, "_estop_reader", only_if_down),
        (lambda s: s.stall("safety", 1500), lambda s: s.request(0.0, 2500), reset_is_granted,
         *GO_ON),
        "safety knows of estop_reader",
    ),
    "a suspended program drives on": (
        (arbiter, "LAPSE_S", 1e9),  # another source drives on, so the vehicle never stands
        (lambda s: s.request(None), lambda s: s.request(0.0, 450, source="nav"),
         lambda s: s.request(0.5, 1500, source="nav"), *GO), "teleop was not neutral",
    ),
    "a ROS node drives on without a pause": (
        (command, "PAUSE_NS", -NS_PER_S),
        (lambda s: s.request(None, 1500), lambda s: s.ros("topic_pub", 0.5, 1500),
         lambda s: s.stop(1500), *RESET), "without a pause of the ROS node",
    ),
    "an override does not hold": (
        (Arbiter, "overruled", unchanged),
        (lambda s: s.request(None), lambda s: s.request(0.0, 1000, source="nav"),
         lambda s: s.request(0.3, 300, source="nav"), lambda s: s.request(0.0, 300),
         lambda s: s.request(None)), "nav was not neutral",
    ),
    "a hold that was meant for a good sonar drives on blind": (
        (SonarOverrides, "updated", knows_at_once),
        (lambda s: s.sonars(FAULT_MM, numbers=FRONT),), "toward sonar 2",
    ),
}  # fmt: skip
