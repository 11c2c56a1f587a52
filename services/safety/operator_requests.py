"""Answers to an operator's reset or held release, with the reason of each refusal.

Both echo safety's heartbeat, so that a call that was delayed is refused. A reset clears all causes
that it names, or nothing. A pressed bumper is the exception: its ``contact`` stays, and what else
is named and gone is cleared. Otherwise each would wait for the other, the reset for the bumper and
the release that frees the bumper for the reset. What is latched and not named stays latched.
"""

from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import Direction
from services.safety.causes import bars_motion
from services.safety.config import Safety
from services.safety.fault_budget import FaultBudget
from services.safety.inputs import Hold, Inputs, Reset
from services.safety.latches import begun, latched, named, ordered, reset, still_there
from services.safety.release import Release
from services.safety.state import Reply, State
from services.safety.trajectory import OPPOSITE

BY_HAND = "Push the vehicle off by hand, then reset."


def answer(
    state: State, inputs: Inputs, settings: Safety, now_ns: int
) -> tuple[State, Reply | None]:
    """Carry out the call that came with the inputs, if one did."""
    match inputs.event:
        case Reset() as call:
            return _reset(state, inputs, call, settings, now_ns)
        case Hold(held=True) as call:
            return _hold(state, inputs, call, settings, now_ns)
        case Hold() as call:
            return _let_go(state, call.echo), Reply(True, "Let go.")
        case _:
            return state, None


def is_creeping(state: State, inputs: Inputs, settings: Safety, now_ns: int) -> bool:
    """Return whether a held release may move the vehicle now."""
    release = state.release
    if not release.is_held(now_ns, settings.release_lease):
        return False
    return not _no_release(state, inputs, settings) and not _no_way(state, release.direction)


def room(state: State, settings: Safety) -> float:
    """Return how many metres may still be travelled before it is time to stop."""
    speed = settings.release_speed
    stopping = speed * settings.react + speed * speed / (2 * settings.deceleration)
    return state.release.left(settings.release_distance - stopping)


def _reset(
    state: State, inputs: Inputs, call: Reset, settings: Safety, now_ns: int
) -> tuple[State, Reply]:
    reason = (
        state.heartbeat.refusal(call.echo, now_ns, round(settings.max_call_age * NS_PER_S))
        or _not_named(state, call)
        or _no_reset(state, inputs, call, settings)
        or _not_at_rest(inputs, settings, now_ns)
    )
    if not reason and state.arbiter.asks_to_move(now_ns):
        reason = "Motion is requested: release the controls first."
    if reason:
        return state, Reply(False, reason)
    held = reset(state.latches, call.causes)
    cleared = tuple(one.id for name, one in state.latches.items() if name not in held)
    credit = state.credit if "flapping" in held else FaultBudget()
    after = replace(_let_go(state, None), latches=held, credit=credit)
    text = _remaining(after, inputs, settings)
    # Who was armed before the trip is not armed any more, by ``disarmed`` while it was held.
    text = text or "Reset: a neutral request is due before the vehicle moves."
    return after, Reply(True, text, cleared)


def _not_named(state: State, call: Reset) -> str:
    """Return why these identities are refused; empty when each names a latched cause."""
    held = latched(state.latches)
    if not held:
        return "Nothing is latched."
    texts = " ".join(state.latches[name].text for name in held)
    if not call.causes:
        return f"The reset names no cause. Latched: {texts} Send the `id` of each as `causes`."
    if set(call.causes) - {state.latches[name].id for name in held}:
        return f"A cause that the reset names is not latched any more. Now latched: {texts}"
    return ""


def _no_reset(state: State, inputs: Inputs, call: Reset, settings: Safety) -> str:
    """Return which cause forbids this reset; empty when there is something to clear."""
    new = begun(state.latches, state.decision)
    if new:  # a trip in the same decision wins: the operator has not seen it
        return f"Not gone yet: {state.latches[new[0]].text}"
    meant = named(state.latches, call.causes)
    stays = [name for name in still_there(state.latches) if name in meant]
    if not stays:
        return ""
    if "contact" not in stays or not _is_pressed(inputs):
        return f"Not gone yet: {state.latches[stays[0]].text}"
    if len(stays) == len(meant):
        return f"Not gone yet: {_pressed(state, inputs, settings)}"
    return ""


def _remaining(state: State, inputs: Inputs, settings: Safety) -> str:
    """Return what is still latched after a reset, for the operator; empty when nothing is."""
    held = latched(state.latches)
    if not held:
        return ""
    if "contact" in held and _is_pressed(inputs):
        return f"Reset all but this: {_pressed(state, inputs, settings)}"
    return f"Reset all but this: {' '.join(state.latches[name].text for name in held)}"


def _pressed(state: State, inputs: Inputs, settings: Safety) -> str:
    """Return that the bumper is still pressed, and what to do about it."""
    what = _no_release(state, inputs, settings) or _way_off(state.release)
    return f"{state.latches['contact'].text} {what}"


def _way_off(release: Release) -> str:
    """Return how to move off the bumper, by the directions that are not forbidden."""
    free = OPPOSITE.keys() - release.forbidden
    if len(free) == len(OPPOSITE):
        return "Hold release to move off, forward or backward."
    (only,) = free
    advice = f"Hold release {only} to move off."
    if only != release.before.direction:
        return advice
    return f"{advice} The vehicle came {only} to the contact: check that way first."


def _hold(
    state: State, inputs: Inputs, call: Hold, settings: Safety, now_ns: int
) -> tuple[State, Reply]:
    late = state.heartbeat.refusal(call.echo, now_ns, round(settings.max_echo_age * NS_PER_S))
    if not late and call.echo is not None and call.echo <= state.release.let_go:
        late = "The release was ended after this call was made: hold it again."
    if late:
        return state, Reply(False, late)
    reason = _no_release(state, inputs, settings) or _no_way(state, call.direction)
    reason = reason or _no_start(state, inputs, call, settings, now_ns)
    direction = call.direction
    if reason or direction is None:
        return replace(state, release=replace(state.release, held_ns=None)), Reply(False, reason)
    state = replace(state, release=state.release.hold(direction, now_ns))
    way = room(state, settings)
    return state, Reply(True, f"Moving {direction} off the bumper, {way:.2f} m left.")


def _no_start(state: State, inputs: Inputs, call: Hold, settings: Safety, now_ns: int) -> str:
    """Return why no release may begin; empty when it may, or when this call only continues one."""
    if not state.release.is_held(now_ns, settings.release_lease):
        return _not_at_rest(inputs, settings, now_ns)
    if state.release.direction == call.direction:
        return ""
    # Otherwise the ramp would continue in the old direction first.
    return "The release is held in the other direction: release the key first."


def _let_go(state: State, echo: int | None) -> State:
    """Return the state with the release ended; an unknown echo counts as the newest."""
    newest = state.heartbeat.number
    echo = newest if echo is None else min(echo, newest)
    return replace(state, release=state.release.end(echo))


def _no_release(state: State, inputs: Inputs, settings: Safety) -> str:
    """Return why the vehicle may not move off the bumper either way; empty when it may."""
    if "contact" not in state.latches:
        return "There is no contact to release."
    if not _is_pressed(inputs):
        return "The bumper is free: reset instead."
    others = ordered(n for n in state.latches if bars_motion(n) and n != "contact")
    if others:
        due = others[0] in latched(state.latches) and others[0] not in still_there(state.latches)
        return state.latches[others[0]].text + (" Reset first." if due else "")
    spent = _spent(state, settings)
    return f"{spent} {BY_HAND}" if spent else ""


def _spent(state: State, settings: Safety) -> str:
    """Return why no release of this contact is left; empty when one is."""
    if state.release.unknown:
        return "Safety has restarted: the travel of an earlier release is unknown."
    if len(state.release.forbidden) == 2:
        return "The bumper was pressed in both directions."
    return "The distance for moving off is used up." if room(state, settings) <= 0 else ""


def _no_way(state: State, direction: Direction | None) -> str:
    """Return why the vehicle may not move off the bumper in this direction."""
    if direction is None:
        return "Choose the direction of the release: forward or backward."
    if direction in state.release.forbidden:
        return f"Release {direction} is forbidden until a reset: the bumper was pressed that way."
    return ""


def _is_pressed(inputs: Inputs) -> bool:
    return inputs.bumper is not None and inputs.bumper.value.pressed


def _not_at_rest(inputs: Inputs, settings: Safety, now_ns: int) -> str:
    velocity = inputs.known_velocity(now_ns, settings.velocity_age)
    if velocity is None:
        return "It is not known whether the vehicle stands: its velocity is not heard."
    return "" if velocity.is_standing else "The vehicle still moves."
