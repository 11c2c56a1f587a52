"""One vehicle: the guided drive, the fit, what it missed, and runs with what it proposes."""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from cli.fit.fit import REACT, Fit, Value, refusal
from cli.settings import Everything
from sim.config import known_profiles, load_model
from sim.model import Model
from verification.fit.drive import GuidedDrive
from verification.fit.trial import Runs, Trial
from verification.fit.truth import truths, unsafe
from verification.search.bus import MS
from verification.search.draw import TURN_BRAKING, draw
from verification.search.stack import PLANE, Stack, replaced

STEP_NS = 10 * MS
NEAR = 0.1  # m to a wall: half of ``safety.margin`` is used up


class Result(Struct, frozen=True, kw_only=True):
    """What the fit of one vehicle is worth."""

    name: str
    proposes: bool
    missing: tuple[str, ...]  # manoeuvres
    unsafe: tuple[str, ...]  # stops that need more than is reckoned with by the proposal
    inside: int  # truths within their intervals
    outside: tuple[str, ...]
    refused: str  # by safety, which would not start with the proposal
    today: Runs | None  # with today's settings; None without a proposal that safety accepts
    proposed: Runs | None  # with the proposed ones

    @property
    def wrong(self) -> list[str]:
        """What failed in the runs with the proposed settings."""
        if self.today is None or self.proposed is None:
            return [self.refused] if self.refused else []
        old, new = self.today, self.proposed
        lap = f"lap: {new.failed} (today: {old.failed or 'completed'})"
        contact = f"contact: {', '.join(new.contacts)} (today: {', '.join(old.contacts) or 'none'})"
        near = f"{new.nearest:.2f} m to a wall (today: {old.nearest:.2f} m)"
        found = (lap, new.failed), (contact, new.contacts), (near, new.nearest < NEAR)
        return [text for text, is_so in found if is_so]


Vehicle = tuple[str, Model, float]  # name, and the angular deceleration of its settings, rad/s^2


def vehicles(runs: int) -> list[Vehicle]:
    """Return the profiles' vehicles and random ones without faults."""
    named = [(name, load_model([name]), 1.0) for name in known_profiles()]
    drawn: list[Vehicle] = []
    seed = 0
    while len(drawn) < runs:
        seed += 1
        one = draw(seed)
        if not one.faulty:
            drawn.append((str(seed), one.model(), float(one.get(TURN_BRAKING, 1.0))))
    return named + drawn


def measure(vehicle: Vehicle) -> Result:
    """Drive a vehicle, compare its fit with the truth, and drive it with the proposal."""
    name, model, turn_braking = vehicle
    found, inside, outside = measured(vehicle), 0, []
    by_name = {each.name: each for each in found.estimates}
    for truth, value in truths(model):
        if truth in by_name and len(by_name[truth].values) > 1:
            low, high = by_name[truth].interval
            if low <= value <= high:
                inside += 1
            else:
                outside.append(f"{truth} {value:.4f}, not in {low:.4f} to {high:.4f}")
    proposes, refused = REACT in found.proposals, refusal(found)
    runs = [
        Trial(model, turn_braking, settings).run()
        for settings in ({}, found.proposals)
        if proposes and not refused
    ]
    today, proposed = runs or (None, None)
    return Result(
        name=name,
        proposes=proposes,
        missing=tuple(found.missing),
        unsafe=tuple(unsafe(found, model)),
        inside=inside,
        outside=tuple(outside),
        refused=refused,
        today=today,
        proposed=proposed,
    )


def measured(vehicle: Vehicle) -> Fit:
    """Return the fit, after a second drive if a unit or the sonars' range must be set first."""
    first = fitted(vehicle, {})
    if REACT in first.proposals or not first.proposals:
        return first
    found = fitted(vehicle, first.proposals)
    found.proposals = {**first.proposals, **found.proposals}
    # Where the sonars end is no reading any more, once it is set.
    shown = {each.name: each for each in first.estimates if each.setting in first.proposals}
    rest = [each for each in found.estimates if each.name not in shown]
    found.estimates = [*shown.values(), *rest]
    return found


def fitted(vehicle: Vehicle, settings: Mapping[str, Value]) -> Fit:
    """Return the fit of a guided drive with these settings."""
    name, model, turn_braking = vehicle
    body = replace(model.vehicle, angular_deceleration=turn_braking)
    stack = Stack(
        model, PLANE, seed=len(name), step_ns=STEP_NS, turn_braking=turn_braking, settings=settings
    )
    return GuidedDrive(stack).run(replaced(replace(Everything(), vehicle=body), settings))
