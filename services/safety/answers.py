"""What an operator's reset or held release is answered, and why not.

A reset clears all that is latched, or nothing. A pressed bumper is the exception: its ``contact``
stays, and what else is latched and gone is cleared. Otherwise each would wait for the other, the
reset for the bumper and the release that frees the bumper for the reset.
"""

from msgspec.structs import replace

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
            return _reset(state, inputs, settings, now_ns)
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


def _reset(state: State, inputs: Inputs, settings: Safety, now_ns: int) -> tuple[State, Reply]:
    if not latched(state.latches):
        return state, Reply(True, "Nothing is latched.")
    reason = _no_reset(state, inputs, settings, now_ns) or _not_at_rest(inputs, settings, now_ns)
    if not reason and state.arbiter.asks_to_move(now_ns):
        reason = "Motion is requested: release the controls first."
    if reason:
        return state, Reply(False, reason)
    held = reset(state.latches)
    credit = state.credit if "flapping" in held else Credit()
    cleared = replace(_let_go(state), latches=held, credit=credit)
    if latched(held):
        return cleared, Reply(True, f"Reset all but this: {_pressed(cleared, inputs, settings)}")
    # Who was armed before the trip is not armed any more, by ``disarmed`` while it was held.
    return cleared, Reply(True, "Reset: a neutral request is due before the vehicle moves.")


def _no_reset(state: State, inputs: Inputs, settings: Safety, now_ns: int) -> str:
    """Say which cause speaks against a reset; empty when there is something to clear."""
    stays = still_there(state.latches)
    if not stays:
        return ""
    # A hit that comes with the reset wins: nobody has seen it yet.
    known = "contact" in stays and state.latches["contact"].since_ns < now_ns
    if not known or not _is_pressed(inputs):
        return f"Not gone yet: {state.latches[stays[0]].text}"
    if stays == latched(state.latches):
        return f"Not gone yet: {_pressed(state, inputs, settings)}"
    return ""


def _pressed(state: State, inputs: Inputs, settings: Safety) -> str:
    """Say that the bumper is still pressed, and what to do about it."""
    what = _no_release(state, inputs, settings) or "Hold release to creep off."
    return f"{state.latches['contact'].text} {what}"


def _hold(state: State, inputs: Inputs, settings: Safety, now_ns: int) -> tuple[State, Reply]:
    reason = _no_release(state, inputs, settings)
    if not reason and not state.release.is_held(now_ns, settings.release_lease):
        reason = _not_at_rest(inputs, settings, now_ns)
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
    if not _is_pressed(inputs):
        return "The bumper is free: reset instead."
    others = ordered(n for n in state.latches if wants_neutral(n) and n != "contact")
    if others:
        due = others[0] in latched(state.latches) and others[0] not in still_there(state.latches)
        return state.latches[others[0]].text + (" Reset first." if due else "")
    if state.release.before is None:
        return (
            "It is not known which way leads off, because no motion was measured before the "
            "bumper was pressed. Push the vehicle off by hand, then reset."
        )
    if room(state, settings) <= 0:
        return "The way off is used up: free the bumper by hand."
    return ""


def _is_pressed(inputs: Inputs) -> bool:
    return inputs.bumper is not None and inputs.bumper.value.pressed


def _not_at_rest(inputs: Inputs, settings: Safety, now_ns: int) -> str:
    velocity = inputs.known_velocity(now_ns, settings.velocity_age)
    if velocity is None:
        return "It is not known whether the vehicle stands: its velocity is not heard."
    return "" if velocity.is_standing else "The vehicle still moves."
