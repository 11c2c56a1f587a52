"""The way since the last counter sample, leg by leg, as the velocities saw it.

The counters say how long the way was and how far it turned; the velocities say what shape it had.
``fitted`` puts the two together.
"""

from collections.abc import Sequence

from msgspec import Struct


class Leg(Struct, frozen=True):
    """One arc; ``seen`` while there was a velocity, else nothing is known of it but its time."""

    distance: float  # m, forward positive
    turn: float  # rad, counter-clockwise positive
    time_s: float
    seen: bool


def total(legs: Sequence[Leg]) -> Leg:
    """Add legs up; the sum is seen if all of them are."""
    return Leg(
        sum(leg.distance for leg in legs),
        sum(leg.turn for leg in legs),
        sum(leg.time_s for leg in legs),
        all(leg.seen for leg in legs),
    )


def fitted(legs: Sequence[Leg], distance: float, turn: float) -> list[Leg]:
    """Return the legs with the counters' distance and turn.

    What the velocities do not explain happened while nobody saw it, or else evenly over the time.
    """
    way = total(legs)
    if way.time_s <= 0:
        return [Leg(distance, turn, 0.0, seen=True)]
    blamed_s = way.time_s if way.seen else sum(leg.time_s for leg in legs if not leg.seen)
    linear, angular = (distance - way.distance) / blamed_s, (turn - way.turn) / blamed_s
    return [
        leg if leg.seen and not way.seen else _faster(leg, linear, angular)
        for leg in legs
    ]  # fmt: skip


def halved(legs: Sequence[Leg]) -> list[Leg]:
    """Return half as many legs for the same way, of a coarser shape."""
    return [total(legs[i : i + 2]) for i in range(0, len(legs), 2)]


def _faster(leg: Leg, linear: float, angular: float) -> Leg:
    distance, turn = leg.distance + linear * leg.time_s, leg.turn + angular * leg.time_s
    return Leg(distance, turn, leg.time_s, leg.seen)
