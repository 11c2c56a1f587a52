"""Mutations of the bridge: remove one protection each, with the expected objection."""

import dataclasses
from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace

from common import keys
from common import messages as m
from common.freshness import NS_PER_S
from common.motion import Command, Twist
from common.wire.framing import Framing
from common.wire.reports import BumperReport
from services.bridge import lease as leases
from services.bridge import readiness
from services.bridge.core import Core
from services.bridge.lease import Lease
from services.bridge.output import Output, Send
from services.bridge.readiness import Readiness
from services.bridge.reflex import Hit
from verification.invariants.net import Disturbance, Envelope
from verification.invariants.process import ROBOT, DriveEnd
from verification.invariants.stack import Stack

# Owner, attribute and replacement of a protection; its scenario; the oracle's objection.
Mutation = tuple[object, str, object, Callable[[Stack], None], str]


def driving(linear: float = 0.5) -> Stack:
    """Return a stack that drives on request of teleop."""
    stack = Stack()
    stack.run(700)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(700)
    stack.sticks["teleop"].requested = (linear, 0.0)
    stack.run(1500)
    assert stack.vehicle.twist.linear == pytest.approx(linear, abs=0.05)
    return stack


def hold(stack: Stack, direction: m.Direction = "backward") -> None:
    """Hold the release for a while."""
    for _ in range(10):
        stack.hold(True, direction)
        stack.run(60)


def safety_dies(stack: Stack) -> None:
    stack.kill("safety", 5000)


def hit_while_a_run_is_under_way(stack: Stack) -> None:
    stack.net.disturbances["motion"] = Disturbance(late_ms=60)
    stack.run(300)
    stack.vehicle.pressed = True


def motions_get_lost(stack: Stack) -> None:
    """End the bridge's lease without safety noticing in time."""
    stack.net.disturbances.update(streams=Disturbance(late_ms=120), motion=Disturbance(lose=1))
    stack.run(250)
    stack.net.disturbances.pop("motion")


def board_freezes_and_safety_hears_late(stack: Stack) -> None:
    """Freeze the board for less than safety notices."""
    stack.net.disturbances["streams"] = Disturbance(late_ms=120)
    stack.run(300)
    stack.vehicle.freeze(240)


def brakes_go_off_and_on(stack: Stack) -> None:
    """Report to safety too late that the board's brake was off."""
    stack.net.disturbances["streams"] = Disturbance(late_ms=120)
    stack.run(300)
    for on, ms in ((False, 60), (True, 60)):
        assert stack.switches(on=on)
        stack.run(ms)


HIT = Framing().pack(BumperReport(True))


def claims_to_brake(core: Core, datagram: bytes) -> Hit | None:
    return Hit(HIT, Send(b"", core.motions.port)) if HIT in datagram else None


def still_armed(lease: Lease, ready: bool) -> Lease:
    return replace(lease, ready=ready)


def safety_dies_latched(stack: Stack) -> None:
    stack.estop()
    stack.run(100)  # the bridge forgets what safety has acknowledged
    stack.kill("safety", 20)
    stack.run(1500)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(700)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def successor(
    stack: Stack, deliver: Callable[[Callable[[Envelope], None], Envelope], None]
) -> None:
    """Kill safety with a latched emergency stop; ``deliver`` passes the link to its successor."""
    stack.estop()
    stack.run(100)
    stack.kill("safety", 20)
    stack.run(25)
    (subscription,) = [
        subscription for subscription in stack.net.subscriptions
        if subscription.owner is stack.safety and subscription.matches(keys.LINK.on(ROBOT))
    ]  # fmt: skip
    take = subscription.take
    subscription.take = lambda envelope: deliver(take, envelope)


def successor_hits_something(stack: Stack) -> None:
    """Latch a contact in the successor before it receives the link, then release."""
    deaf_until_ns = stack.net.now_ns + NS_PER_S

    def late(take: Callable[[Envelope], None], envelope: Envelope) -> None:
        if stack.net.now_ns > deaf_until_ns:
            take(envelope)

    successor(stack, late)
    stack.vehicle.measured = Twist(0.2)  # still, so that a way off is known
    stack.run(40)
    stack.vehicle.pressed, stack.vehicle.measured = True, None
    stack.sticks["teleop"].requested = None
    stack.run(2500)
    hold(stack)


def successor_hears_of_no_latch(stack: Stack) -> None:
    """Deliver to the successor a link sample from before the latch."""

    def old(take: Callable[[Envelope], None], envelope: Envelope) -> None:
        assert isinstance(envelope.message, m.Link)
        take(
            dataclasses.replace(
                envelope, message=replace(envelope.message, latched_by=None, armed=True)
            )
        )

    successor(stack, old)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(1500)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def safety_hangs(stack: Stack) -> None:
    """Stop while safety hangs so long that it loses its session; then reset, and drive."""
    stack.stall("safety", 1500)
    stack.run(700)
    stack.estop()
    stack.run(1500)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(700)
    seen = stack.seen
    assert seen is not None
    causes = tuple(one for one in seen.causes if one.name != "estop")
    stack.reset(replace(seen, causes=causes))
    stack.run(300)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def unacknowledged(lease: Lease, received_ns: int) -> tuple[Lease, Command]:
    return replace(lease, sent_ns=received_ns), Command.BRAKE


def overwritten(lease: Lease, motion: m.Motion) -> int | None:
    if motion.latched:
        return motion.boot
    return None if lease.latched_by == motion.boot else lease.latched_by


def whoever(lease: Lease, motion: m.Motion) -> Any:
    order, refusal = ORDER(replace(lease, latched_by=None), motion)
    return order, refusal


def untold(lease: Lease, motion: m.Motion, *rest: Any, **more: Any) -> Any:
    return ON_MOTION(lease, replace(motion, latched=False), *rest, **more)


def still_neutral(lease: Lease, now_ns: int, lease_ns: int) -> Lease:
    return replace(EXPIRE(lease, now_ns, lease_ns), neutral=lease.neutral)


def unjudged(lease: Lease, seq: int, now_ns: int) -> tuple[Lease, Command]:
    return replace(lease, sent_ns=now_ns), Command.BRAKE


def from_anybody(link: DriveEnd, topic: keys.Topic[Any], handler: Any, **names: Any) -> None:
    """Subscribe on the router as well."""
    link._process.subscribe(topic, handler, **names)


def authority_is_copied(stack: Stack) -> None:
    hand = stack.hand
    copy = m.Motion(command=Command.RUN, linear=0.9, seq=2**19, boot=stack.safety.boot)
    hand.send(Envelope(keys.MOTION.on(ROBOT), copy, hand.boot, stack.net.now_ns))


ORDER = leases._order
EXPIRE, ON_MOTION = leases.expire, leases.on_motion


MUTATIONS: dict[str, Mutation] = {
    "the bridge's lease never ends": (
        leases, "expire", lambda lease, *_: lease, safety_dies, "a RUN is held",
    ),
    "no neutral after a lease": (
        leases, "expire", still_neutral, motions_get_lost, "no neutral motion came",
    ),
    "silence is not noticed": (
        readiness, "link_on_tick", lambda link, *_: link, board_freezes_and_safety_hears_late,
        "the board is silent",
    ),
    "brakes that are off": (
        Readiness, "ready", property(lambda self: self.link.state == "up"), brakes_go_off_and_on,
        "its brakes are not both on",
    ),
    "no neutral after brakes that were off": (
        leases, "on_ready", still_armed, brakes_go_off_and_on, "no neutral motion came",
    ),
    "the bridge remembers no latch": (
        leases, "on_motion", untold, safety_dies_latched, "bridge knows of estop",
    ),
    "a successor's own latch hides the one that is due": (
        leases, "_latched_by", overwritten, successor_hits_something, "safety knows of estop",
    ),
    "a successor need not know of the latch": (
        leases, "_order", whoever, successor_hears_of_no_latch, "bridge knows of estop",
    ),
    "a hit needs no judgement": (
        leases, "on_hit", unjudged, hit_while_a_run_is_under_way, "bridge knows of contact",
    ),
    "an emergency stop needs no acknowledgement": (
        leases, "on_estop", unacknowledged, safety_hangs, "bridge knows of estop",
    ),
    "the bridge does not brake for an emergency stop": (
        Core, "estop", lambda *_: Output(), safety_hangs, "without a BRAKE",
    ),
    "the drive link takes messages of the router": (
        DriveEnd, "subscribe", from_anybody, authority_is_copied, "a RUN that no safety sent",
    ),
    "the reflex does not brake": (
        Core, "reflex", claims_to_brake, hit_while_a_run_is_under_way, "without a BRAKE",
    ),
}  # fmt: skip
