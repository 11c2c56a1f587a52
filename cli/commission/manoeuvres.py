"""Manoeuvres of the guided drive on the ground, and the space that they need. Pure.

====== ================================================== =========================
ending what ends the motion                               what the vehicle does
====== ================================================== =========================
stop   the checkout stops publishing: its lease ends      safety commands STOP
brake  the checkout publishes an emergency stop           safety commands BRAKE
slow   the checkout requests zero                         RUN ramps down
====== ================================================== =========================

Within each kind the speeds rise, and each direction is followed by its opposite, so that the
vehicle stays near its place. The checkout ends a motion once the speed was steady for ``STEADY_S``,
at the latest at the limits of distance, angle and time.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Literal

from msgspec import Struct

from cli.commission.texts import ENGLISH, Say
from common.motion import STILL, Twist
from common.standstill import stopping_s
from services.safety.config import SafetyConfig

Ending = Literal["stop", "brake", "slow"]
Group = Literal["standstill", "straight", "spot", "curve", "full-turn", "return"]
GROUPS: tuple[Group, ...] = ("standstill", "straight", "spot", "curve", "full-turn", "return")

STANDSTILL_S = 10.0
STEADY_S = 0.8  # of steady speed before the motion ends
RESERVE, RESERVE_S = 1.5, 0.4  # for a vehicle that accelerates slower than safety's ramp
STANDING_RESERVE_S = 1.5  # of the time limit, for the start of the motion
# Shares of the greatest speed.
STOPS = (0.2, 0.45, 0.5, 0.6, 0.7, 0.8)  # five of 0.4 or more, as `t2 fit` needs
TURN_STOPS = (0.3, 0.45, 0.5, 0.6, 0.7, 0.8)
BRAKES = (0.3, 0.5, 0.8)
MIDDLE, CURVE, FULL_TURN = 0.5, 0.4, 0.4
FIRST_MPS, FIRST_RADPS = 0.1, 0.2  # of the first motion, if the vehicle may be as fast
RETURN_MPS = 0.2
NEAR_M = 0.05  # from the beginning: no return is needed
LAG_S = 0.1  # until a request of zero slows the vehicle down


class Manoeuvre(Struct, frozen=True):
    """One motion from standstill to standstill; without a twist the vehicle stands."""

    group: Group
    title: str
    twist: Twist  # requested
    limit: Twist  # m and rad, as positive numbers: where the checkout ends the motion
    seconds: float  # when it does so at the latest
    ending: Ending = "slow"
    steady_s: float = STEADY_S  # of steady speed before the motion ends
    ahead: float = 0.0  # m of free space in the direction of travel, from the bumper
    aside: float = 0.0  # m of free space to the inner side of a curve
    around: float = 0.0  # m of free space around the vehicle's middle

    @property
    def is_straight(self) -> bool:
        """Whether it drives without turning."""
        return self.twist.linear != 0 and self.twist.angular == 0

    @property
    def is_turn(self) -> bool:
        """Whether it turns on the spot."""
        return self.twist.linear == 0 and self.twist.angular != 0

    def is_faster(self, than: Twist) -> bool:
        """Return whether it is faster than these speeds on an axis."""
        return abs(self.twist.linear) > than.linear or abs(self.twist.angular) > than.angular


def announcement(it: Manoeuvre, say: Say = ENGLISH) -> str:
    """Return what will happen, how far at most, and the free space that it needs."""
    if it.twist.is_zero:
        return say("space.stands", seconds=it.seconds)
    return say(
        "space.needs",
        space=space(it, say), reach=reach(it.limit, say), seconds=math.ceil(it.seconds),
    )  # fmt: skip


def space(it: Manoeuvre, say: Say = ENGLISH) -> str:
    """Return the free space that a motion needs."""
    if it.is_turn:
        return say("space.around", around=_metres(it.around))
    where = "ahead" if it.twist.linear > 0 else "behind"
    if it.is_straight:
        return say(f"space.{where}", ahead=_metres(it.ahead))
    side = "left" if it.twist.angular * it.twist.linear > 0 else "right"
    metres = {"ahead": _metres(it.ahead), "aside": _metres(it.aside)}
    return say(f"space.curve_{where}", side=side, **metres)


def _metres(distance: float) -> str:
    """Return a free distance as text, rounded up."""
    return f"{math.ceil(distance * 10 - 1e-9) / 10:.1f} m"


def reach(limit: Twist, say: Say = ENGLISH) -> str:
    """Return the limits of a motion as text."""
    axis = ("both" if limit.angular else "linear") if limit.linear else "angular"
    return say(f"reach.{axis}", linear=limit.linear, degrees=math.degrees(limit.angular))


def speed(twist: Twist) -> str:
    """Return the magnitudes of a twist as text."""
    parts = [f"{abs(twist.linear):.2f} m/s"] if twist.linear else []
    parts += [f"{abs(twist.angular):.2f} rad/s"] if twist.angular else []
    return ", ".join(parts) or "0 m/s"


def plan(settings: SafetyConfig, say: Say = ENGLISH) -> tuple[Manoeuvre, ...]:
    """Return the manoeuvres in their order, without the return to the beginning."""
    return (standstill(say), *_straight(settings, say), *_spot(settings, say),
            *_curve(settings, say), full_turn(settings, say))  # fmt: skip


def standstill(say: Say = ENGLISH) -> Manoeuvre:
    """Return the standstill that shows bias and noise."""
    return Manoeuvre("standstill", say("manoeuvre.standstill"), STILL, STILL, STANDSTILL_S)


def full_turn(settings: SafetyConfig, say: Say = ENGLISH) -> Manoeuvre:
    """Return a turn of 360 degrees: zero is requested so much earlier as the ramp takes."""
    rate = FULL_TURN * settings.vehicle.max_angular
    ramp = rate**2 / settings.vehicle.angular_deceleration / 2 + rate * LAG_S
    limit = Twist(0.0, math.tau - ramp)
    twist = Twist(angular=rate)
    seconds = math.tau / rate + rate / settings.safety.angular_acceleration + STANDING_RESERVE_S
    return Manoeuvre(
        "full-turn", say("manoeuvre.full_turn", speed=speed(twist)), twist, limit, seconds,
        steady_s=math.inf, around=_around(settings),
    )  # fmt: skip


def homing(travelled: float, settings: SafetyConfig, say: Say = ENGLISH) -> Manoeuvre | None:
    """Return the motion back after a travel (m, forward positive); None if it is near."""
    if abs(travelled) < NEAR_M:
        return None
    top = min(RETURN_MPS, settings.vehicle.max_linear)
    # As fast as the ramps up and down leave room for.
    up, down = settings.safety.linear_acceleration, settings.vehicle.deceleration
    rate = min(top, math.sqrt(abs(travelled) / (1 / up + 1 / down)))
    limit = abs(travelled) - rate**2 / down / 2 - rate * LAG_S
    twist = Twist(linear=-math.copysign(rate, travelled))
    return Manoeuvre(
        "return", say("manoeuvre.return", way=direction(twist), distance=abs(travelled)), twist,
        Twist(max(limit, NEAR_M / 2), 0.0), limit / rate + rate / up + STANDING_RESERVE_S,
        steady_s=math.inf, ahead=abs(travelled) + settings.safety.margin,
    )  # fmt: skip


def missing_stops(
    done: Iterable[Manoeuvre], planned: Iterable[Manoeuvre], say: Say = ENGLISH
) -> tuple[str, ...]:
    """Return the planned kinds of stops of which a fit needs more than were done, as texts."""
    counts = Counter((it.ending, direction(it.twist)) for it in done)
    kinds = {(it.ending, direction(it.twist)) for it in planned}
    wanted: dict[Ending, int] = {"stop": len(STOPS), "brake": len(BRAKES)}
    return tuple(
        say(
            "manoeuvre.missing",
            ending=ending.upper(),
            way=_way(each, say),
            count=number - counts[ending, each],
            number=number,
        )
        for ending, number in wanted.items()
        for each in ("forward", "backward", "left", "right")
        if (ending, each) in kinds and counts[ending, each] < number
    )


def _straight(settings: SafetyConfig, say: Say) -> Iterator[Manoeuvre]:
    top = settings.vehicle.max_linear
    first = min(FIRST_MPS, STOPS[0] * top)
    yield from _pairs("straight", ((Twist(first), "slow"),), settings, say)
    yield from _pairs("straight", ((Twist(each * top), "stop") for each in STOPS), settings, say)
    yield from _pairs("straight", ((Twist(MIDDLE * top), "slow"),), settings, say)
    yield from _pairs("straight", ((Twist(each * top), "brake") for each in BRAKES), settings, say)


def _spot(settings: SafetyConfig, say: Say) -> Iterator[Manoeuvre]:
    top = settings.vehicle.max_angular
    first = min(FIRST_RADPS, TURN_STOPS[0] * top)
    turns = (Twist(0.0, each * top) for each in TURN_STOPS)
    brakes = (Twist(0.0, each * top) for each in BRAKES)
    yield from _pairs("spot", ((Twist(0.0, first), "slow"),), settings, say)
    yield from _pairs("spot", ((twist, "stop") for twist in turns), settings, say)
    yield from _pairs("spot", ((Twist(0.0, MIDDLE * top), "slow"),), settings, say)
    yield from _pairs("spot", ((twist, "brake") for twist in brakes), settings, say)


def _curve(settings: SafetyConfig, say: Say) -> Iterator[Manoeuvre]:
    body = settings.vehicle
    curves = (Twist(CURVE * body.max_linear, side * CURVE * body.max_angular) for side in (1, -1))
    yield from _pairs("curve", ((twist, "stop") for twist in curves), settings, say)


def _pairs(
    group: Group, motions: Iterable[tuple[Twist, Ending]], settings: SafetyConfig, say: Say
) -> Iterator[Manoeuvre]:
    """Yield each motion, and then the one back on the same curve."""
    return chain.from_iterable(
        (_manoeuvre(group, twist, ending, settings, say),
         _manoeuvre(group, twist.scaled(-1), ending, settings, say))
        for twist, ending in motions
    )  # fmt: skip


def _manoeuvre(
    group: Group, twist: Twist, ending: Ending, settings: SafetyConfig, say: Say
) -> Manoeuvre:
    own, body = settings.safety, settings.vehicle
    steady_s = STEADY_S + RESERVE_S
    linear, angular = abs(twist.linear), abs(twist.angular)
    rising_s = stopping_s(twist, own.linear_acceleration, own.angular_acceleration)
    # In a curve one axis has its speed sooner, and waits for the other.
    limit = Twist(
        RESERVE * linear * (rising_s - linear / own.linear_acceleration / 2) + linear * steady_s,
        RESERVE * angular * (rising_s - angular / own.angular_acceleration / 2)
        + angular * steady_s,
    )
    lease_s = settings.leased["checkout"].lease if "checkout" in settings.leased else 0.0
    stop_s = stopping_s(twist, body.deceleration, body.angular_deceleration)
    # Until its lease ends, and the time of a stop as the settings reckon with it.
    driven = limit.linear + linear * (lease_s + settings.reaction + stop_s / 2)
    turned = limit.angular + angular * (lease_s + settings.reaction + stop_s / 2)
    radius = linear / angular if angular else math.inf
    aside = radius * (1 - math.cos(min(turned, math.pi))) if linear and angular else 0.0
    ahead = radius if angular and turned > math.pi / 2 else driven
    return Manoeuvre(
        group, say(f"manoeuvre.{ending}", way=_way(direction(twist), say), speed=speed(twist)),
        twist, limit,
        RESERVE * rising_s + steady_s + STANDING_RESERVE_S, ending,
        ahead=min(ahead, driven) + own.margin if linear else 0.0,
        aside=aside + own.margin if linear and angular else 0.0,
        around=_around(settings),
    )  # fmt: skip


def _around(settings: SafetyConfig) -> float:
    body = settings.vehicle
    return math.hypot(body.length, body.width) / 2 + settings.safety.margin


def direction(twist: Twist) -> str:
    """Return the direction of a twist, as ``stops`` names it."""
    driving = ("forward" if twist.linear > 0 else "backward") if twist.linear else ""
    turning = ("left" if twist.angular > 0 else "right") if twist.angular else ""
    return f"{driving} turning {turning}" if driving and turning else driving or turning


def _way(direction: str, say: Say) -> str:
    """Return a direction as text."""
    driving, is_curve, side = direction.partition(" turning ")
    if is_curve:
        return say("manoeuvre.curve", way=driving, side=side)
    is_turn = driving in ("left", "right")
    return say("manoeuvre.turning" if is_turn else "manoeuvre.driving", way=driving)
