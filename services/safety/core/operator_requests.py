"""Operator requests: carries out resets and releases, or returns the reason of a refusal.

A reset echoes safety's heartbeat, so a delayed one is refused. It clears all causes that it names,
or none. A pressed bumper is the exception: its ``contact`` stays latched, and the other
named causes are cleared. Otherwise reset and release would deadlock: the reset needs a free bumper,
and the release that frees it needs the reset. Causes that the reset does not name stay latched.
"""

from msgspec.structs import replace

from services.safety.config import Safety
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
from services.safety.core.sources import DriveChannel
from services.safety.core.state import Reply, State
from t2.messages import ResetRequest

BY_HAND = "Push the vehicle off by hand, then reset."
BUMPER_FREE = "The bumper is free. Next: reset."
LET_GO = "A release begins with a new hold: let go first."


def room(state: State, settings: Safety) -> float:
    """Return the remaining travel of a release in metres, less the stopping distance."""
    stopping = stopping_distance(settings.release_speed, settings.reaction, settings.deceleration)
    return state.release.remaining(settings.release_distance - stopping)


def carry_out(
    call: ResetRequest, state: State, inputs: Inputs, settings: Safety, now_ns: int
) -> tuple[State, Reply]:
    """Carry out a reset, or return the reason of its refusal."""
    reason = (
        state.heartbeat.refusal(call.echo, now_ns)
        or _not_named(state, call)
        or _no_reset(state, inputs, call, settings)
        or _not_standing(inputs, settings, now_ns)
    )
    if not reason and state.arbiter.requests_motion(now_ns):
        reason = "Motion is requested: release the controls first."
    if reason:
        return state, Reply(False, reason)
    held = reset(state.latches, call.causes)
    cleared = tuple(one.id for name, one in state.latches.items() if name not in held)
    budget = state.fault_budget if "flapping" in held else FaultBudget()
    after = replace(state, latches=held, fault_budget=budget)
    text = _remaining(after, inputs, settings)
    # ``disarmed`` has already disarmed every source while the cause was held.
    text = text or "Reset. Release the controls, then drive."
    return after, Reply(True, text, cleared)


def _not_named(state: State, call: ResetRequest) -> str:
    """Return why these identities are refused; empty when each names a latched cause."""
    held = latched(state.latches)
    if not held:
        return "Nothing is latched."
    texts = " ".join(state.latches[name].text for name in held)
    if not call.causes:
        return f"The reset names no cause. Latched: {texts} Send the `id` of each as `causes`."
    if set(call.causes) - {state.latches[name].id for name in held}:
        return f"A cause that the reset names is no longer latched. Now latched: {texts}"
    return ""


def _no_reset(state: State, inputs: Inputs, call: ResetRequest, settings: Safety) -> str:
    """Return which cause forbids this reset; empty when it may clear something."""
    new = begun(state.latches, state.decision)
    if new:  # a trip in the same decision wins: the operator has not seen it
        return f"Still present: {state.latches[new[0]].text}"
    targets = named(state.latches, call.causes)
    stays = [name for name in still_present(state.latches) if name in targets]
    if not stays:
        return ""
    if "contact" not in stays or not _is_pressed(inputs):
        return f"Still present: {state.latches[stays[0]].text}"
    if len(stays) == len(targets):
        return f"Still present: {_pressed(state, inputs, settings)}"
    return ""


def _remaining(state: State, inputs: Inputs, settings: Safety) -> str:
    """Return the causes still latched after a reset, for the operator; empty without any."""
    held = latched(state.latches)
    if not held:
        return ""
    if "contact" in held and _is_pressed(inputs):
        return f"Reset, but still latched: {_pressed(state, inputs, settings)}"
    return f"Reset, but still latched: {' '.join(state.latches[name].text for name in held)}"


def _pressed(state: State, inputs: Inputs, settings: Safety) -> str:
    """Return the text of a pressed bumper with the remedy."""
    what = _no_release(state, inputs, settings) or _way_off(state.release)
    return f"{state.latches['contact'].text} {what}"


def _way_off(release: Release) -> str:
    """Return the remedy, by the directions that are not forbidden."""
    free = SIGN.keys() - release.forbidden
    if len(free) == len(SIGN):
        return "Hold release to move off, forward or backward."
    (only,) = free
    advice = f"Hold release {only} to move off."
    if only != release.came.direction:
        return advice
    return f"{advice} The vehicle drove {only} into the contact: check that direction first."


def answered(state: State, inputs: Inputs, settings: Safety, now_ns: int) -> Release:
    """Return the release with the answer to what the source in control requests.

    A refusal ends it until the next neutral request. Only a vehicle that does not stand yet is
    waited for.
    """
    release, source = state.release, state.arbiter.in_control(now_ns)
    # 2 equivalent mutants: without a source its request does not matter.
    asked = state.arbiter.channels[source].release if source else "none"
    if source is None or asked == "none":
        return replace(release, direction=None, refusal="")
    if source not in settings.operators:
        reason = f"{source} may not release: only a source that an operator holds may."
    elif reason := _no_release(state, inputs, settings):
        pass
    elif asked in release.forbidden:
        reason = f"Release {asked} is forbidden until a reset: the bumper was pressed that way."
    else:
        reason = _not_let_go(release, source, state.arbiter.channels[source])
    if reason:
        return replace(release, direction=None, refusal=reason, barred_ns=now_ns)
    moves = "" if release.direction else _not_standing(inputs, settings, now_ns)
    return replace(release, source=source, direction=None if moves else asked, refusal=moves)


def _not_let_go(release: Release, source: str, channel: DriveChannel) -> str:
    """Return that a neutral request is due: before each release of a source in a direction."""
    if release.direction is not None:
        continues = (release.source, release.direction) == (source, channel.release)
        return "" if continues else LET_GO
    neutral_ns = channel.neutral_ns
    return "" if neutral_ns is not None and neutral_ns > release.barred_ns else LET_GO


def _no_release(state: State, inputs: Inputs, settings: Safety) -> str:
    """Return why no release is possible in either direction; empty when one is."""
    if "contact" not in state.latches:
        return "There is no contact to release."
    if not _is_pressed(inputs):
        return BUMPER_FREE
    others = ordered((BARRING & state.latches.keys()) - {"contact"})
    if others:
        due = others[0] in latched(state.latches) and others[0] not in still_present(state.latches)
        return state.latches[others[0]].text + (" Reset first." if due else "")
    why = spent(state, settings)
    return f"{why} {BY_HAND}" if why else ""


def spent(state: State, settings: Safety) -> str:
    """Return why the releases of this contact are used up; empty when they are not."""
    if state.release.unknown:
        return "Safety has restarted: the travel of an earlier release is unknown."
    if len(state.release.forbidden) == 2:
        return "The bumper was pressed in both directions."
    return "The distance for moving off is used up." if room(state, settings) <= 0 else ""


def _is_pressed(inputs: Inputs) -> bool:
    return inputs.bumper is not None and inputs.bumper.value.pressed


def _not_standing(inputs: Inputs, settings: Safety, now_ns: int) -> str:
    velocity = inputs.known_velocity(now_ns, settings.times.velocity_age)
    if velocity is None:
        return "Standstill is not confirmed: no velocity is received."
    return "" if velocity.value.is_standing else "The vehicle still moves."
