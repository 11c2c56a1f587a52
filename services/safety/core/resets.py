"""Resets: clears the latched causes that a reset names, or returns the reason of its refusal.

A reset echoes safety's heartbeat, so a delayed one is refused. It clears all causes that it names,
or none. A pressed bumper is the exception: its ``contact`` stays latched, and the other
named causes are cleared. Otherwise reset and release would deadlock: the reset needs a free bumper,
and the release that frees it needs the reset. Causes that the reset does not name stay latched.
"""

from msgspec.structs import replace

from services.safety.config import SafetyConfig
from services.safety.core.causes import FaultBudget, begun, latched, named, reset, still_present
from services.safety.core.inputs import Inputs
from services.safety.core.release import SIGN, Release
from services.safety.core.release_requests import not_standing, unavailable
from services.safety.core.state import Reply, State
from t2.messages import Direction, Phrase, Phrases, ResetRequest

KEYSTROKES: dict[Direction, str] = {"forward": "F", "backward": "B"}


def carry_out(
    call: ResetRequest, state: State, inputs: Inputs, settings: SafetyConfig, now_ns: int
) -> tuple[State, Reply]:
    """Carry out a reset, or return the reason of its refusal."""
    reason = (
        state.heartbeat.refusal(call.echo, now_ns)
        or _not_named(state, call)
        or _no_reset(state, inputs, call, settings)
        or not_standing(inputs, settings, now_ns)
    )
    if not reason and state.arbiter.requests_motion(now_ns):
        reason = (Phrase("reset.motion"),)
    if reason:
        return state, Reply(False, reason)
    held = reset(state.latches, call.causes)
    cleared = tuple(one.id for name, one in state.latches.items() if name not in held)
    budget = state.fault_budget if "flapping" in held else FaultBudget()
    after = replace(state, latches=held, fault_budget=budget)
    return after, Reply(True, _outcome(after, inputs, settings), cleared)


def _not_named(state: State, call: ResetRequest) -> Phrases:
    """Return why these identities are refused; empty when each names a latched cause."""
    held = latched(state.latches)
    if not held:
        return (Phrase("reset.nothing"),)
    if not call.causes:
        return Phrase("reset.no_cause"), *_described(state)
    if set(call.causes) - {state.latches[name].id for name in held}:
        return Phrase("reset.other_cause"), *_described(state)
    return ()


def _no_reset(state: State, inputs: Inputs, call: ResetRequest, settings: SafetyConfig) -> Phrases:
    """Return which cause forbids this reset; empty when it may clear something."""
    present = Phrase("reset.still_present")
    new = begun(state.latches, state.decision)
    if new:  # a trip in the same decision wins: the operator has not seen it
        return present, *state.latches[new[0]].phrases
    targets = named(state.latches, call.causes)
    stays = [name for name in still_present(state.latches) if name in targets]
    if not stays:
        return ()
    if "contact" not in stays or not inputs.is_pressed:
        return present, *state.latches[stays[0]].phrases
    if len(stays) == len(targets):
        return present, *_pressed(state, inputs, settings)
    return ()


def _outcome(state: State, inputs: Inputs, settings: SafetyConfig) -> Phrases:
    """Return the answer to a reset that was carried out, with the causes that stay latched."""
    held = latched(state.latches)
    if not held:
        return (Phrase("reset.done"),)
    if "contact" in held and inputs.is_pressed:
        return Phrase("reset.partial"), *_pressed(state, inputs, settings)
    return Phrase("reset.partial"), *_described(state)


def _described(state: State) -> Phrases:
    """Return the phrases of all latched causes."""
    return tuple(each for name in latched(state.latches) for each in state.latches[name].phrases)


def _pressed(state: State, inputs: Inputs, settings: SafetyConfig) -> Phrases:
    """Return the phrases of a pressed bumper with the next step."""
    step = unavailable(state, inputs, settings) or _way_off(state.release)
    return *state.latches["contact"].phrases, *step


def _way_off(release: Release) -> Phrases:
    """Return the next step, by the directions that are not forbidden."""
    free = SIGN.keys() - release.forbidden
    if len(free) == len(SIGN):
        return (Phrase("release.any_way"),)
    (only,) = free
    step = Phrase("release.one_way", {"key": KEYSTROKES[only], "direction": only})
    if only != release.came.direction:
        return (step,)
    return step, Phrase("release.into_contact", {"direction": only})
