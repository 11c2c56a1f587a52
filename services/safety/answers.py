"""What an operator's reset or held release is answered, and why not."""

from dataclasses import replace

from services.safety.causes import wants_neutral
from services.safety.config import Safety
from services.safety.flapping import Credit
from services.safety.inputs import Hold, Inputs, Reset
from services.safety.latches import latched, ordered, reset, still_there
from services.safety.state import Reply, State


def answer(
    state: State, inputs: Inputs, settings: Safety, now_ns: int
) -> tuple[State, Reply | None]:
    """Carry out the call that came with the inputs, if one did."""
    match inputs.event:
        case Reset():
            return _reset(state, inputs, now_ns)
        case Hold(held=True):
            return _hold(state, inputs, settings, now_ns)
        case Hold():
            return _let_go(state), Reply(True, "Let go.")
        case _:
            return state, None


def is_creeping(state: State, inputs: Inputs, settings: Safety, now_ns: int) -> bool:
    """Tell whether a held release may move the vehicle now."""
    held = state.release.is_held(now_ns, settings.release_lease)
    return held and not _no_release(state, inputs, settings)


def room(state: State, settings: Safety) -> float:
    """Return how many metres may still be crept before it is time to stop."""
    speed = settings.release_speed
    stopping = speed * settings.react + speed * speed / (2 * settings.deceleration)
    return state.release.left(settings.release_distance - stopping)


def _reset(state: State, inputs: Inputs, now_ns: int) -> tuple[State, Reply]:
    if not latched(state.latches):
        return state, Reply(True, "Nothing is latched.")
    reason = still_there(state.latches) or _not_at_rest(inputs)
    if not reason and state.arbiter.asks_to_move(now_ns):
        reason = "Motion is requested: release the controls first."
    if reason:
        return state, Reply(False, reason)
    cleared = replace(_let_go(state), latches=reset(state.latches), credit=Credit())
    # Who was armed before the trip is not armed any more, by ``disarmed`` while it was held.
    return cleared, Reply(True, "Reset: a neutral request is due before the vehicle moves.")


def _hold(state: State, inputs: Inputs, settings: Safety, now_ns: int) -> tuple[State, Reply]:
    reason = _no_release(state, inputs, settings)
    if not reason and not state.release.is_held(now_ns, settings.release_lease):
        reason = _not_at_rest(inputs)
    if reason:
        return _let_go(state), Reply(False, reason)
    state = replace(state, release=replace(state.release, held_ns=now_ns))
    return state, Reply(True, f"Creeping off the bumper, {room(state, settings):.2f} m left.")


def _let_go(state: State) -> State:
    return replace(state, release=replace(state.release, held_ns=None))


def _no_release(state: State, inputs: Inputs, settings: Safety) -> str:
    """Say why the vehicle may not creep off; empty when it may."""
    if "contact" not in state.latches:
        return "There is no contact to release."
    if inputs.bumper is None or not inputs.bumper.value.pressed:
        return "The bumper is free: reset instead."
    others = ordered(n for n in state.latches if wants_neutral(n) and n != "contact")
    if others:
        return state.latches[others[0]].text
    if state.release.before is None:
        return "It is not known which way leads off: the vehicle has not moved."
    if room(state, settings) <= 0:
        return "The way off is used up: free the bumper by hand."
    return ""


def _not_at_rest(inputs: Inputs) -> str:
    if inputs.measured is None:
        return "It is not known whether the vehicle stands."
    return "" if inputs.measured.is_standing else "The vehicle still moves."
