"""One vehicle: the guided drive, the fit, and what it missed."""

from msgspec import Struct
from msgspec.structs import replace

from cli.settings import Everything
from sim.config import known_profiles, load_model
from sim.model import Model
from verification.fit.drive import GuidedDrive
from verification.fit.truth import truths, unsafe
from verification.search.bus import MS
from verification.search.draw import TURN_BRAKING, draw
from verification.search.stack import PLANE, Stack

STEP_NS = 10 * MS


class Result(Struct, frozen=True, kw_only=True):
    """What the fit of one vehicle is worth."""

    name: str
    proposes: bool
    missing: tuple[str, ...]  # manoeuvres
    unsafe: tuple[str, ...]  # stops that need more than is reckoned with by the proposal
    inside: int  # truths within their intervals
    outside: tuple[str, ...]


def vehicles(runs: int) -> list[tuple[str, Model, float]]:
    """Return the profiles' vehicles and random ones without faults, by name.

    With each comes the angular deceleration of its settings, rad/s^2.
    """
    named = [(name, load_model([name]), 1.0) for name in known_profiles()]
    drawn: list[tuple[str, Model, float]] = []
    seed = 0
    while len(drawn) < runs:
        seed += 1
        one = draw(seed)
        if not one.faulty:
            drawn.append((str(seed), one.model(), float(one.get(TURN_BRAKING, 1.0))))
    return named + drawn


def measure(vehicle: tuple[str, Model, float]) -> Result:
    """Drive a vehicle, and compare its fit with the truth."""
    name, model, turn_braking = vehicle
    body = replace(model.vehicle, angular_deceleration=turn_braking)
    stack = Stack(model, PLANE, seed=len(name), step_ns=STEP_NS, turn_braking=turn_braking)
    found = GuidedDrive(stack).run(replace(Everything(), vehicle=body))
    inside, outside = 0, []
    by_name = {each.name: each for each in found.estimates}
    for truth, value in truths(model):
        if truth in by_name and len(by_name[truth].values) > 1:
            low, high = by_name[truth].interval
            if low <= value <= high:
                inside += 1
            else:
                outside.append(f"{truth} {value:.4f}, not in {low:.4f} to {high:.4f}")
    return Result(
        name=name,
        proposes="safety.react" in found.proposals,
        missing=tuple(found.missing),
        unsafe=tuple(unsafe(found, model)),
        inside=inside,
        outside=tuple(outside),
    )
