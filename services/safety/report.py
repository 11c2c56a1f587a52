"""Reports: the motion message, the published state with its text, and transitions as events."""

from collections.abc import Iterator

from msgspec import Struct

from common.freshness import NS_PER_S
from common.messages import Cause, Level, Limits, Motion, Release, SafetyState
from common.motion import RUN, Twist
from services.safety.causes import BARRING, BY_NAME
from services.safety.inputs import Event as Trigger
from services.safety.inputs import Inputs, Reset
from services.safety.latches import GOOD_SAMPLES, latched, ordered
from services.safety.operator_requests import BUMPER_FREE, BY_HAND, room, spent
from services.safety.policy import Policy
from services.safety.state import State
from services.safety.trajectory import OPPOSITE

MOVING = ("run", "slow")
# Event names that differ from the cause's name.
EVENT_NAMES = {"driver_left": "driver_fault", "driver_right": "driver_fault"}
# What the operator does about a latched cause that is still present, before a reset.
STILL_PRESENT = {
    "estop": "It is still pressed or requested: release it, then reset.",
    "estop_keepalive": "Start its program again, then reset.",
}
MOVE_OFF = "It is still pressed: move off first, then reset."
RESET_OTHERS = "It is still pressed: reset first, then move off."


class Transition(Struct, frozen=True):
    """One transition, published as an event."""

    name: str
    level: Level
    text: str
    about: dict[str, str | None]


def motion_message(state: State, inputs: Inputs) -> Motion:
    """Return the motion message of a decision on these inputs."""
    verdict = state.verdict
    return Motion(
        command=verdict.command,
        linear=verdict.twist.linear,
        angular=verdict.twist.angular,
        source=verdict.source,
        judged=verdict.acked[1],
        judged_boot=verdict.acked[0],
        latched=bool(latched(state.latches)),
        predecessor=inputs.link.value.latched_by if inputs.link else None,
        estop=state.estop,
    )


def state_message(policy: Policy, state: State, now_ns: int) -> SafetyState:
    """Return the published state, with the heartbeat of ``state``."""
    causes = tuple(
        Cause(
            name=name,
            action=BY_NAME[name].action,
            age=(now_ns - state.latches[name].since_ns) / NS_PER_S,
            text=state.latches[name].text,
            id=state.latches[name].id,
        )
        for name in ordered(state.latches)
    )
    return SafetyState(
        verdict=state.verdict.name,
        latched=latched(state.latches),
        causes=causes,
        source=state.verdict.source,
        limits=_limits(policy, state, now_ns),
        heartbeat=state.heartbeat.number,
        text=sentence(state, by_hand=bool(spent(state, policy.settings))),
        release=_release(policy, state, now_ns) if "contact" in state.latches else None,
        release_refusal=state.release.refusal,
        estop_keepalives=state.keepalives.states(now_ns),
        limit_sources=state.speed_limits.states(state.verdict.limited_by, now_ns),
    )


def sentence(state: State, *, by_hand: bool = False) -> str:
    """Return one sentence: why the vehicle does or does not move.

    ``by_hand`` means that no release may move the vehicle off a pressed bumper any more.
    """
    names = ordered(state.latches)
    if state.verdict.command is RUN:
        control = _source_text(state.verdict.source)
        slowing = [state.latches[n].text for n in names if BY_NAME[n].action == "slow"]
        return " ".join([*slowing[:1], control])
    worst = names[0]
    text = state.latches[worst].text
    if worst not in latched(state.latches):
        return text
    if state.latches[worst].good >= GOOD_SAMPLES:
        return f"{text} Reset to go on."
    if worst == "contact":
        return f"{text} {_way_off(state, by_hand=by_hand)}"
    return f"{text} {STILL_PRESENT.get(worst, 'The cause is still present: fix it, then reset.')}"


def _way_off(state: State, *, by_hand: bool) -> str:
    """Return the next step at a pressed bumper, as safety accepts it."""
    if by_hand:
        return BY_HAND
    # A reset clears the others, and only then a release is accepted.
    return RESET_OTHERS if len(latched(state.latches)) > 1 else MOVE_OFF


def signature(state: State) -> tuple[object, ...]:
    """Return the part of the state whose change is published at once."""
    ids = tuple(state.latches[name].id for name in latched(state.latches))
    release = state.release.forbidden, bool(state.release.refusal)
    return state.verdict.name, ordered(state.latches), ids, state.verdict.source, *release


def transitions(before: State, after: State, trigger: Trigger | None) -> Iterator[Transition]:
    """Yield the transitions of one decision."""
    old, new = before.verdict, after.verdict
    tripped = [name for name in latched(after.latches) if _is_new(before, after, name)]
    for name in tripped:
        text = after.latches[name].text
        yield Transition(EVENT_NAMES.get(name, name), "error", text, {"cause": name})
    worst = next(iter(ordered(after.latches)), None)
    # A cause that latches, and a release, have events of their own.
    is_stop = old.name in MOVING and new.name not in MOVING and "release" not in before.latches
    if is_stop and worst and worst not in tripped:
        level: Level = "info" if worst in ("no_request", "neutral") else "warning"
        yield Transition("stop", level, sentence(after), {"cause": worst, "verdict": new.name})
    # The end of control is worth an event of its own only while no latch is the reason.
    if old.control != new.control and (new.control or not latched(after.latches)):
        yield Transition(
            "source", "info", _source_text(new.control), {"from": old.control, "to": new.control}
        )
    if ("release" in before.latches) != ("release" in after.latches):
        began = "release" in after.latches
        text = "Creeping off the bumper." if began else "No longer creeping off the bumper."
        yield Transition("release" if began else "release_end", "warning", text, {})
    yield from _release_events(before.release.refusal, after.release.refusal)
    if isinstance(trigger, Reset) and (reply := new.reply) is not None:
        if reply.done:
            yield Transition("reset", "info", reply.text, {})
        else:
            yield Transition("reset_refused", "warning", reply.text, {})


def _is_new(before: State, after: State, name: str) -> bool:
    """Return whether this occurrence of a cause began with this decision.

    A program repeats its emergency stop: while one is latched, another one is no transition.
    """
    known = before.latches.get(name)
    return known is None or (known.id != after.latches[name].id and name != "estop")


def _release_events(before: str, after: str) -> Iterator[Transition]:
    """Yield the first refusal of a request; its text may change while the key is held."""
    if after == BUMPER_FREE != before:
        yield Transition("release_free", "info", after, {})
    elif after and not before:
        yield Transition("release_refused", "warning", after, {})


def _source_text(source: str | None) -> str:
    return f"{source} is in control." if source else "No source is in control."


def _release(policy: Policy, state: State, now_ns: int) -> Release:
    """Return the published state of the release."""
    release = state.release
    came, free = release.before, None
    if came.direction is not None and OPPOSITE[came.direction] not in release.forbidden:
        free = OPPOSITE[came.direction]
    return Release(
        believed_free=free,
        travelled=came.net,
        age=None if came.ended_ns is None else (now_ns - came.ended_ns) / NS_PER_S,
        forbidden=tuple(sorted(release.forbidden)),
        left=room(state, policy.settings),
    )


def _limits(policy: Policy, state: State, now_ns: int) -> Limits:
    """Return what a drive request may reach now: nothing while a cause forbids every motion."""
    if not BARRING.isdisjoint(state.latches):
        return Limits(forward=0.0, backward=0.0, angular=0.0)
    planner, settings = policy.planner, policy.settings
    distances = planner.with_overrides(state.sonar_array.cautious, state, state.verdict.source)

    def most(asked: Twist) -> Twist:
        twist = planner.limited(asked, state.latches)
        twist, _ = state.speed_limits.limited(twist, now_ns)
        return twist.scaled(planner.zones.limit(twist, distances).factor)

    return Limits(
        forward=most(Twist(settings.max_linear)).linear,
        backward=-most(Twist(-settings.max_linear)).linear,
        angular=min(
            most(Twist(0.0, settings.max_angular)).angular,
            -most(Twist(0.0, -settings.max_angular)).angular,
        ),
    )
