"""Release requests: whether a release moves the vehicle now, or the reason why it does not.

A release is part of a drive request of an operator's source. It is possible while ``contact`` is
the only cause that forbids motion, the bumper is pressed and travel is left.
"""

from msgspec.structs import replace

from services.safety.config import SafetyConfig
from services.safety.core.arbiter import DriveChannel
from services.safety.core.causes import BARRING, latched, ordered, still_present
from services.safety.core.inputs import Inputs
from services.safety.core.release import Release, stopping_distance
from services.safety.core.state import State
from t2.messages import Phrase, Phrases

BY_HAND = Phrase("next.by_hand")
BUMPER_FREE = (Phrase("release.bumper_free"),)
LET_GO = (Phrase("release.let_go"),)


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
    elif reason := unavailable(state, inputs, settings):
        pass
    elif asked in release.forbidden:
        reason = (Phrase("release.forbidden", {"direction": asked}),)
    else:
        reason = _not_let_go(release, source, state.arbiter.channels[source])
    if reason:
        return replace(release, direction=None, refusal=reason, barred_ns=now_ns)
    moves = () if release.direction else not_standing(inputs, settings, now_ns)
    return replace(release, source=source, direction=None if moves else asked, refusal=moves)


def _not_let_go(release: Release, source: str, channel: DriveChannel) -> Phrases:
    """Return that a neutral request is due: before each release of a source in a direction."""
    if release.direction is not None:
        continues = (release.source, release.direction) == (source, channel.release)
        return () if continues else LET_GO
    neutral_ns = channel.neutral_ns
    return () if neutral_ns is not None and neutral_ns > release.barred_ns else LET_GO


def unavailable(state: State, inputs: Inputs, settings: SafetyConfig) -> Phrases:
    """Return why no release is possible in either direction; empty when one is."""
    if "contact" not in state.latches:
        return (Phrase("release.no_contact"),)
    if not inputs.is_pressed:
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


def room(state: State, settings: SafetyConfig) -> float:
    """Return the remaining travel of a release in metres, less the stopping distance."""
    speed, deceleration = settings.safety.release_speed, settings.vehicle.deceleration
    stopping = stopping_distance(speed, settings.reaction, deceleration)
    return state.release.remaining(settings.safety.release_distance - stopping)


def not_standing(inputs: Inputs, settings: SafetyConfig, now_ns: int) -> Phrases:
    """Return that the vehicle moves, or that nobody knows; empty when it stands."""
    velocity = inputs.known_velocity(now_ns, settings.times.velocity_age)
    if velocity is None:
        return (Phrase("standstill.unknown"),)
    return () if velocity.value.is_standing else (Phrase("standstill.moving"),)
