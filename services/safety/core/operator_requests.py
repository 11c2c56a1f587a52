"""Operator requests: carries out resets and releases, or returns the reason of a refusal.

A reset echoes safety's heartbeat, so a delayed one is refused. It clears all causes that it names,
or none. A pressed bumper is the exception: its ``contact`` stays latched, and the other
named causes are cleared. Otherwise reset and release would deadlock: the reset needs a free bumper,
and the release that frees it needs the reset. Causes that the reset does not name stay latched.
"""

from msgspec.structs import replace

from services.safety.config import SafetyConfig
from services.safety.core.arbiter import DriveChannel
from services.safety.core.causes import (
    BARRING,
    FaultBudget,
    begun,
    latched,
    named,
    ordered,
    reset,
    still_present,
)
from services.safety.core.inputs import Inputs
from services.safety.core.release import SIGN, Release, stopping_distance
from services.safety.core.state import Reply, State
from t2.messages import Direction, Phrase, Phrases, ResetRequest

BY_HAND = Phrase("next.by_hand")
BUMPER_FREE = (Phrase("release.bumper_free"),)
LET_GO = (Phrase("release.let_go"),)
KEYSTROKES: dict[Direction, str] = {"forward": "F", "backward": "B"}


def room(state: State, settings: SafetyConfig) -> float:
    """Return the remaining travel of a release in metres, less the stopping distance."""
    speed, deceleration = settings.safety.release_speed, settings.vehicle.deceleration
    stopping = stopping_distance(speed, settings.reaction, deceleration)
    return state.release.remaining(settings.safety.release_distance - stopping)


def carry_out(
    call: ResetRequest, state: State, inputs: Inputs, settings: SafetyConfig, now_ns: int
) -> tuple[State, Reply]:
    """Carry out a reset, or return the reason of its refusal."""
    reason = (
        state.heartbeat.refusal(call.echo, now_ns)
        or _not_named(state, call)
        or _no_reset(state, inputs, call, settings)
        or _not_standing(inputs, settings, now_ns)
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
    if "contact" not in stays or not _is_pressed(inputs):
        return present, *state.latches[stays[0]].phrases
    if len(stays) == len(targets):
        return present, *_pressed(state, inputs, settings)
    return ()


def _outcome(state: State, inputs: Inputs, settings: SafetyConfig) -> Phrases:
    """Return the answer to a reset that was carried out, with the causes that stay latched."""
    held = latched(state.latches)
    if not held:
        return (Phrase("reset.done"),)
    if "contact" in held and _is_pressed(inputs):
        return Phrase("reset.partial"), *_pressed(state, inputs, settings)
    return Phrase("reset.partial"), *_described(state)


def _described(state: State) -> Phrases:
    """Return the phrases of all latched causes."""
    return tuple(each for name in latched(state.latches) for each in state.latches[name].phrases)


def _pressed(state: State, inputs: Inputs, settings: SafetyConfig) -> Phrases:
    """Return the phrases of a pressed bumper with the next step."""
    step = _no_release(state, inputs, settings) or _way_off(state.release)
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


def answered(state: State, inputs: Inputs, settings: SafetyConfig, now_ns: int) -> Release:
    """Return the release with the answer to what the source in control requests.

    A refusal ends it until the next neutral request. Only a vehicle that does not stand yet is
    waited for.
    """
    release, source = state.release, state.arbiter.in_control(now_ns)
    asked = state.arbiter.channels[source].release if source else "none"
    if source is None or asked == "none":
        return replace(release, direction=None, refusal=())
    if source not in settings.safety.operators:
        reason: Phrases = (Phrase("release.no_operator", {"source": source}),)
    elif reason := _no_release(state, inputs, settings):
        pass
    elif asked in release.forbidden:
        reason = (Phrase("release.forbidden", {"direction": asked}),)
    else:
        reason = _not_let_go(release, source, state.arbiter.channels[source])
    if reason:
        return replace(release, direction=None, refusal=reason, barred_ns=now_ns)
    moves = () if release.direction else _not_standing(inputs, settings, now_ns)
    return replace(release, source=source, direction=None if moves else asked, refusal=moves)


def _not_let_go(release: Release, source: str, channel: DriveChannel) -> Phrases:
    """Return that a neutral request is due: before each release of a source in a direction."""
    if release.direction is not None:
        continues = (release.source, release.direction) == (source, channel.release)
        return () if continues else LET_GO
    neutral_ns = channel.neutral_ns
    return () if neutral_ns is not None and neutral_ns > release.barred_ns else LET_GO


def _no_release(state: State, inputs: Inputs, settings: SafetyConfig) -> Phrases:
    """Return why no release is possible in either direction; empty when one is."""
    if "contact" not in state.latches:
        return (Phrase("release.no_contact"),)
    if not _is_pressed(inputs):
        return BUMPER_FREE
    others = ordered((BARRING & state.latches.keys()) - {"contact"})
    if others:
        due = others[0] in latched(state.latches) and others[0] not in still_present(state.latches)
        phrases = state.latches[others[0]].phrases
        return (*phrases, Phrase("next.reset_first")) if due else phrases
    why = spent(state, settings)
    return (*why, BY_HAND) if why else ()


def spent(state: State, settings: SafetyConfig) -> Phrases:
    """Return why the releases of this contact are used up; empty when they are not."""
    if state.release.unknown:
        return (Phrase("release.unknown"),)
    if len(state.release.forbidden) == 2:
        return (Phrase("release.both_ways"),)
    return (Phrase("release.used_up"),) if room(state, settings) <= 0 else ()


def _is_pressed(inputs: Inputs) -> bool:
    return inputs.bumper is not None and inputs.bumper.value.pressed


def _not_standing(inputs: Inputs, settings: SafetyConfig, now_ns: int) -> Phrases:
    velocity = inputs.known_velocity(now_ns, settings.times.velocity_age)
    if velocity is None:
        return (Phrase("standstill.unknown"),)
    return () if velocity.value.is_standing else (Phrase("standstill.moving"),)
