"""Reports: the published state, and transitions as events."""

from collections.abc import Iterator
from typing import Any

from msgspec import Struct

from common.freshness import NS_PER_S
from common.motion import RUN, Twist
from services.safety.core.causes import BARRING, BY_NAME, GOOD_SAMPLES, latched, ordered
from services.safety.core.policy import Policy
from services.safety.core.release_requests import BUMPER_FREE, BY_HAND, room, spent
from services.safety.core.sonar import Sonar
from services.safety.core.sonars import UNSEEN
from services.safety.core.state import State
from t2.messages import (
    SONAR_NAMES,
    Cause,
    CauseName,
    Direction,
    EventName,
    Level,
    Limits,
    Phrase,
    Phrases,
    Release,
    SafetyState,
)
from t2.words import render

MOVING = ("run", "slow")
OPPOSITE: dict[Direction | None, Direction] = {"forward": "backward", "backward": "forward"}
# Event names that differ from the cause's name.
EVENT_NAMES: dict[CauseName, EventName] = {
    "driver_left": "driver_fault",
    "driver_right": "driver_fault",
}
# The next step at a latched cause that is still present, before a reset.
STILL_PRESENT: dict[CauseName, Phrase] = {
    "estop": Phrase("next.estop"),
    "estop_keepalive": Phrase("next.estop_keepalive"),
}
MOVE_OFF = Phrase("next.move_off")
RESET_OTHERS = Phrase("next.reset_others")


class Transition(Struct, frozen=True):
    """One transition, published as an event."""

    name: EventName
    level: Level
    phrases: Phrases
    about: dict[str, str | None]


def state_message(policy: Policy, state: State, now_ns: int) -> SafetyState:
    """Return the published state, with the heartbeat of ``state``."""
    causes = tuple(_cause(state, name, now_ns) for name in ordered(state.latches))
    phrases = summary(state, by_hand=bool(spent(state, policy.settings)))
    return SafetyState(
        verdict=state.verdict.name,
        latched=latched(state.latches),
        causes=causes,
        source=state.verdict.source,
        limits=_limits(policy, state, now_ns),
        heartbeat=state.heartbeat.number,
        text=render(phrases),
        phrases=phrases,
        release=_release(policy, state, now_ns) if "contact" in state.latches else None,
        release_refusal=render(state.release.refusal),
        refusal_phrases=state.release.refusal,
        limit_sources=state.speed_limits.states(state.verdict.limited_by, now_ns),
        doubted_sonars=tuple(
            name
            for name, doubt in _doubted(state.sonar_array.sonars).items()
            if doubt in ("suspect", *UNSEEN)  # what is too near to measure is there
        ),
    )


def _cause(state: State, name: CauseName, now_ns: int) -> Cause:
    held, phrases = state.latches[name], described(state, name)
    return Cause(
        name=name,
        action=BY_NAME[name].action,
        age=(now_ns - held.since_ns) / NS_PER_S,
        text=render(phrases),
        phrases=phrases,
        id=held.id,
    )


def summary(state: State, *, by_hand: bool = False) -> Phrases:
    """Return why the vehicle does or does not move, and the next step.

    ``by_hand`` means that no release may move the vehicle off a pressed bumper any more.
    """
    names = ordered(state.latches)
    if state.verdict.command is RUN:
        slowing = [described(state, name) for name in names if BY_NAME[name].action == "slow"]
        return *(slowing[0] if slowing else ()), _control(state.verdict.source)
    worst = names[0]
    why = described(state, worst)
    if worst not in latched(state.latches):
        return why
    if state.latches[worst].good >= GOOD_SAMPLES:
        return *why, Phrase("next.reset")
    if worst == "contact":
        return *why, _way_off(state, by_hand=by_hand)
    return *why, STILL_PRESENT.get(worst, Phrase("next.fix"))


def _way_off(state: State, *, by_hand: bool) -> Phrase:
    """Return the next step at a pressed bumper, as safety accepts it."""
    if by_hand:
        return BY_HAND
    # A reset clears the others, and only then a release is accepted.
    return RESET_OTHERS if len(latched(state.latches)) > 1 else MOVE_OFF


def described(state: State, name: CauseName) -> Phrases:
    """Return the phrases of a held cause; of the newest decision for a cause of planning."""
    verdict, default = state.verdict, state.latches[name].phrases
    match name:
        case "neutral":
            return _overruled(state, verdict.source) or default
        case "blocked" if verdict.blocked_by is not None:
            return _blocked(state, verdict.blocked_by)
        case "obstacle" if verdict.slowed_by is not None:
            return _slowed(state, verdict.slowed_by)
        case "limit" if verdict.limited_by:
            because = state.speed_limits.channels[verdict.limited_by].because
            return (Phrase("limit.by", {"source": f"{verdict.limited_by}{because}"}),)
        case "sonar":
            return _doubts(state.sonar_array.sonars)
        case _:
            return default


def _overruled(state: State, source: str | None) -> Phrases:
    """Return that another source overruled the requesting one; otherwise empty."""
    channel = state.arbiter.channels.get(source or "")
    if channel is None or not channel.overruled_by:
        return ()
    return (Phrase("neutral.overruled", {"other": channel.overruled_by, "source": source}),)


def _blocked(state: State, sonar: int) -> Phrases:
    name, one = SONAR_NAMES[sonar], state.sonar_array.sonars[sonar]
    if not one.fault:
        return (Phrase("blocked.near", {"sonar": name, "distance": one.distance}),)
    why = Phrase("blocked.untrusted", {"sonar": name, "fault": one.fault})
    passable = sonar in state.sonar_array.unseen and "release" not in state.latches
    return (why, Phrase("blocked.creep_past")) if passable else (why,)


def _slowed(state: State, sonar: int) -> Phrases:
    name, one = SONAR_NAMES[sonar], state.sonar_array.sonars[sonar]
    if one.fault:
        return (Phrase("obstacle.untrusted", {"sonar": name, "fault": one.fault}),)
    if one.suspect:
        return (Phrase("obstacle.suspect", {"sonar": name, "distance": one.same}),)
    return (Phrase("obstacle.near", {"sonar": name, "distance": one.distance}),)


def _doubted(sonars: tuple[Sonar, ...]) -> dict[str, str]:
    """Return the untrusted sonars by name, with the reason."""
    doubts = [one.fault or ("suspect" if one.suspect else "") for one in sonars]
    return {name: doubt for name, doubt in zip(SONAR_NAMES, doubts, strict=True) if doubt}


def _doubts(sonars: tuple[Sonar, ...]) -> Phrases:
    """Return which sonars are not trusted, and why."""
    found = _doubted(sonars)
    if len(found) == len(sonars) and len(reasons := set(found.values())) == 1:
        return (Phrase("sonar.all", {"fault": reasons.pop()}),)
    return tuple(
        Phrase("sonar.one", {"sonar": name, "fault": doubt}) for name, doubt in found.items()
    )


def signature(state: State) -> tuple[object, ...]:
    """Return the part of the state whose change is published at once."""
    ids = tuple(state.latches[name].id for name in latched(state.latches))
    release = state.release.forbidden, bool(state.release.refusal)
    return state.verdict.name, ordered(state.latches), ids, state.verdict.source, *release


def transitions(before: State, after: State) -> Iterator[Transition]:
    """Yield the transitions of one decision."""
    old, new = before.verdict, after.verdict
    tripped = [name for name in latched(after.latches) if _is_new(before, after, name)]
    for name in tripped:
        event: Any = EVENT_NAMES.get(name, name)  # a latched cause has an event of its name
        yield Transition(event, "error", after.latches[name].phrases, {"cause": name})
    worst = next(iter(ordered(after.latches)), None)
    # A cause that latches, and a release, have events of their own.
    is_stop = old.name in MOVING and new.name not in MOVING and "release" not in before.latches
    if is_stop and worst and worst not in tripped:
        level: Level = "info" if worst in ("no_request", "neutral") else "warning"
        yield Transition("stop", level, summary(after), {"cause": worst, "verdict": new.name})
    # The end of control is worth an event of its own only while no latch is the reason.
    if old.control != new.control and (new.control or not latched(after.latches)):
        yield Transition(
            "source", "info", (_control(new.control),), {"from": old.control, "to": new.control}
        )
    if ("release" in before.latches) != ("release" in after.latches):
        edge: EventName = "release" if "release" in after.latches else "release_end"
        yield Transition(edge, "warning", (Phrase(f"event.{edge}"),), {})
    yield from _release_events(before.release.refusal, after.release.refusal)
    if (reply := new.reply) is not None:
        if reply.done:
            yield Transition("reset", "info", reply.phrases, {})
        else:
            yield Transition("reset_refused", "warning", reply.phrases, {})


def _is_new(before: State, after: State, name: CauseName) -> bool:
    """Return whether this occurrence of a cause began with this decision.

    A program repeats its emergency stop: while one is latched, another one is no transition.
    """
    known = before.latches.get(name)
    return known is None or (known.id != after.latches[name].id and name != "estop")


def _release_events(before: Phrases, after: Phrases) -> Iterator[Transition]:
    """Yield the first refusal of a request; its text may change while the key is held."""
    if after == BUMPER_FREE != before:
        yield Transition("release_free", "info", after, {})
    elif after and not before:
        yield Transition("release_refused", "warning", after, {})


def _control(source: str | None) -> Phrase:
    return Phrase("control.of", {"source": source}) if source else Phrase("control.none")


def _release(policy: Policy, state: State, now_ns: int) -> Release:
    """Return the published state of the release, with the way that is believed free, and why."""
    release, came = state.release, state.release.came
    free = OPPOSITE.get(came.direction)
    return Release(
        believed_free=None if free in release.forbidden else free,
        travelled=came.travelled,
        age=None if came.ended_ns is None else (now_ns - came.ended_ns) / NS_PER_S,
        forbidden=tuple(sorted(release.forbidden)),
        left=room(state, policy.settings),
    )


def _limits(policy: Policy, state: State, now_ns: int) -> Limits:
    """Return what a drive request may reach now: nothing while a cause forbids every motion."""
    if not BARRING.isdisjoint(state.latches):
        return Limits(forward=0.0, backward=0.0, angular=0.0)
    planner, body = policy.planner, policy.settings.vehicle
    distances = planner.cautious(state, state.verdict.source)

    def most(asked: Twist) -> Twist:
        twist = planner.limited(asked)
        twist, _ = state.speed_limits.limited(twist, now_ns)
        return twist.scaled(planner.zones.limit(twist, distances).factor)

    return Limits(
        forward=most(Twist(body.max_linear)).linear,
        backward=-most(Twist(-body.max_linear)).linear,
        angular=min(
            most(Twist(0.0, body.max_angular)).angular,
            -most(Twist(0.0, -body.max_angular)).angular,
        ),
    )
