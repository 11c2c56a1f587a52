"""Policy: one decision, from inputs and state to the verdict for the bridge.

Each decision takes these steps, always in this order, so that a trip wins over an event that
arrives with it:

1. accept    accept or refuse a message of a source (``arbiter.py``, ``limits.py``,
             ``keepalive.py``)
2. sense     update sonars, runaway, standstill, trajectory and the travel of a release
3. observe   observe every cause that does not depend on a request (``conditions.py``)
4. handle    carry out a reset (``operator_requests.py``)
5. arm       arm the sources that are neutral, disarm those that are overruled; begin, continue or
             end a release
6. conclude  plan the requested motion (``motion.py``), then apply the worst action (``causes.py``)

RUN has one origin: the end of ``_conclude``, when no held cause demands STOP or BRAKE and a fresh
request exists. A sample that shows a new contact needs none of this: ``brake_for_contact`` answers
it first, and the decision that follows on the same inputs latches the contact.
"""

from collections.abc import Iterable

from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import Motion
from common.messages import Verdict as VerdictName
from common.motion import BRAKE, RUN, STILL, STOP, Command, Twist
from common.settings import Vehicle
from services.safety.arbiter import Arbiter
from services.safety.causes import BARRING, BY_NAME, Clears, bars_motion, clears, wants_neutral
from services.safety.channel import Admission
from services.safety.conditions import observe_inputs
from services.safety.config import Safety
from services.safety.core.motion_watch import MotionWatch, Supervisor
from services.safety.inputs import (
    DriveRequest,
    Inputs,
    KeepaliveRequest,
    LimitRequest,
)
from services.safety.keepalive import Keepalives
from services.safety.latches import Latches, Observation, latched, observe, ordered
from services.safety.limits import SpeedLimits
from services.safety.motion import Plan, Planner, observations
from services.safety.operator_requests import answered, handle
from services.safety.sonar import Rules
from services.safety.sonar_array import SonarFilter
from services.safety.state import State, Verdict

LONGEST_STEP_S = 0.1  # between two decisions; a stalled process must not skip ahead

COMMANDS: dict[VerdictName, Command] = {
    "run": RUN,
    "slow": RUN,
    "stop": STOP,
    "brake": BRAKE,
}


class Policy:
    """Decides with the settings and the vehicle's geometry; holds no state."""

    def __init__(self, settings: Safety, vehicle: Vehicle) -> None:
        self.settings = settings
        self.planner = Planner(settings, vehicle)
        rules = Rules(settings.hysteresis, settings.stuck_travel)
        self._sonar_filter = SonarFilter(
            self.planner.zones, rules, settings.ultrasonic_age, self.planner.creep_room
        )
        self._supervisor = Supervisor(settings)

    def start(self) -> State:
        """Return the state of a service that has just started."""
        settings = self.settings
        return State(
            Arbiter(settings.sources),
            SpeedLimits(settings.limits),
            Keepalives(settings.estop_keepalive, settings.estop_keepalive_timeout),
        )

    def decide(self, state: State, inputs: Inputs, now_ns: int) -> tuple[State, Verdict]:
        """Return the new state and the verdict; the event in the inputs is handled once."""
        step_s = min((now_ns - (state.decided_ns or now_ns)) / NS_PER_S, LONGEST_STEP_S)
        state = replace(state, decision=state.decision + 1)
        state, refused = self._accept(state, inputs, now_ns)
        state = self._sense(state, inputs, step_s, now_ns)
        state = self._observe(state, inputs, now_ns)
        state, reply = handle(state, inputs, self.settings, now_ns)
        state = self._arm(state, now_ns)
        state = replace(state, release=answered(state, inputs, self.settings, now_ns))
        state, verdict = self._conclude(state, inputs, step_s, now_ns)
        verdict = replace(verdict, refused=refused, reply=reply)
        state = replace(
            state,
            decided_ns=now_ns,
            verdict=verdict,
            estop_connection=inputs.estop_connection or state.estop_connection,
            estop=inputs.link.value.estop if inputs.link else None,
        )
        return state, verdict

    def _accept(self, state: State, inputs: Inputs, now_ns: int) -> tuple[State, str]:
        event, settings = inputs.event, self.settings
        if event is None:
            return state, ""
        is_keepalive = isinstance(event, KeepaliveRequest)
        max_age_s = settings.estop_keepalive_timeout if is_keepalive else settings.max_echo_age
        admission = Admission(state.heartbeat, round(max_age_s * NS_PER_S), now_ns)
        match event:
            case DriveRequest():
                arbiter, refused = state.arbiter.accept(event, admission)
                return replace(state, arbiter=arbiter), refused
            case LimitRequest():
                limits, refused = state.speed_limits.accept(event, admission)
                return replace(state, speed_limits=limits), refused and f"limit_{refused}"
            case KeepaliveRequest():
                keepalives, refused = state.keepalives.accept(event, admission)
                return replace(state, keepalives=keepalives), refused and f"keepalive_{refused}"
            case _:
                return state, ""

    def _sense(self, state: State, inputs: Inputs, step_s: float, now_ns: int) -> State:
        settings, sent = self.settings, state.verdict
        known = inputs.known_velocity(now_ns, settings.velocity_age)
        sonar_array = self._sonar_filter.update(state.sonar_array, inputs.ultrasonic, known, now_ns)
        trajectory, counter = state.trajectory, inputs.counter
        if inputs.mileage and counter:
            trajectory = trajectory.follow(counter, inputs.mileage.received_ns)
        release = state.release
        if "contact" in state.latches:
            moved = sent.twist if sent.command is RUN else None  # only a release runs then
            reach = self.planner.reach
            release = release.moving(moved, known, counter, reach=reach, dt_s=step_s, now_ns=now_ns)
        return replace(
            state,
            sonar_array=sonar_array,
            motion=self._watch(state, inputs, known, step_s, now_ns),
            release=release,
            trajectory=trajectory,
        )

    def _watch(
        self, state: State, inputs: Inputs, known: Twist | None, step_s: float, now_ns: int
    ) -> MotionWatch:
        velocity = inputs.velocity
        return self._supervisor.follow(
            state.motion,
            state.verdict.twist,
            Latest(known, velocity.received_ns) if known and velocity else None,
            inputs.mileage if inputs.counter else None,
            step_s=step_s,
            now_ns=now_ns,
        )

    def _observe(self, state: State, inputs: Inputs, now_ns: int) -> State:
        settle_ns = round(self.settings.settle * NS_PER_S)
        tick = (0, now_ns)
        standstill = state.motion.standstill
        names = state.arbiter.conflict(now_ns) + state.speed_limits.conflicts(now_ns)
        conflicts = ", ".join(names)
        seen = [
            *observe_inputs(inputs, self.settings, state, now_ns),
            *state.speed_limits.observations(now_ns),
            Observation("runaway", self._supervisor.runs_away(state.motion), tick),
            Observation("uncommanded_motion", standstill.left, tick),
            Observation(
                "not_stopping",
                standstill.is_late(now_ns),
                # 1 equivalent mutant: this cause clears by time, without a token.
                tick,
                standstill.text,
            ),
            Observation(
                "two_publishers", bool(conflicts), tick, f"Two publishers use {conflicts}."
            ),
        ]
        held = observe(state.latches, seen, now_ns, settle_ns, state.decision)
        was_good, is_good = not _failing(state.latches), not _failing(held)
        budget = state.fault_budget.updated(now_ns, was_good and not is_good, is_good)
        flapping = Observation("flapping", budget.is_spent, tick)
        held = observe(held, [flapping], now_ns, decision=state.decision)
        release = state.release
        if "contact" in held:
            old = state.latches.get("contact")
            release = release.after(old, held["contact"], state.trajectory, now_ns)
            release = replace(release, unknown=release.unknown or "predecessor" in held)
        return replace(state, latches=held, fault_budget=budget, release=release)

    def _arm(self, state: State, now_ns: int) -> State:
        arbiter = state.arbiter
        if state.sonar_array.unseen or state.overrides.since:
            operators = self.settings.operators & arbiter.requesting_zero(now_ns)
            overrides = state.overrides.updated(state.sonar_array.unseen, operators, now_ns)
            state = replace(state, overrides=overrides)
        disarm = any(wants_neutral(name) for name in state.latches)
        arbiter = arbiter.disarmed() if disarm else arbiter.armed(now_ns)
        return replace(state, arbiter=arbiter.overruled(now_ns))

    def _conclude(
        self, state: State, inputs: Inputs, step_s: float, now_ns: int
    ) -> tuple[State, Verdict]:
        suspended = {"contact"} if state.release.direction else set()
        requested = self.planner.requested(state, now_ns)
        barred = _worst(_barring(state.latches) - suspended) != "run"
        plan = Plan()
        if requested and not barred:
            measured = inputs.known_velocity(now_ns, self.settings.velocity_age) or STILL
            plan = self.planner.plan(state, measured, requested, step_s)
        seen = observations(state, requested, plan, now_ns)
        held = observe(state.latches, seen, now_ns, decision=state.decision)
        state = replace(state, latches=held)
        worst = _worst(set(held) - suspended)
        command = COMMANDS[worst]
        if command is STOP and state.motion.standstill.rolls:
            command = BRAKE
        source = requested.source if requested else None
        verdict = Verdict(
            name=_name(worst, held),
            command=command,
            twist=plan.twist if command is RUN else STILL,
            source=source,
            control=source if source and BARRING.isdisjoint(held) else None,
            acked=_acked(inputs),
            limited_by=requested.limited_by if requested else None,
        )
        return state, verdict


def brake_for_contact(state: State, inputs: Inputs) -> Motion | None:
    """Return BRAKE when the bumper sample shows a contact that is not held yet."""
    bumper = inputs.bumper
    if bumper is None or not bumper.value.pressed or "contact" in state.latches:
        return None
    return Motion(
        command=BRAKE,
        judged=bumper.value.seq,
        judged_boot=bumper.value.boot,
        latched=True,
        predecessor=inputs.link.value.latched_by if inputs.link else None,
    )


def _worst(names: Iterable[str]) -> VerdictName:
    """Return the worst action of these causes; "run" without any."""
    first = next(iter(ordered(names)), None)
    return BY_NAME[first].action if first else "run"


def _name(worst: VerdictName, held: Latches) -> VerdictName:
    """Return the verdict's name: "inhibited" while inputs or a neutral request are due."""
    if worst != "stop" or latched(held):
        return worst
    return "inhibited" if _settling(held) or "neutral" in held else "stop"


def _barring(held: Latches) -> set[str]:
    """Return the causes that forbid every motion."""
    return {name for name in held if bars_motion(name)}


def _settling(held: Iterable[str]) -> bool:
    return any(clears(name) is Clears.SETTLED for name in held)


def _failing(held: Latches) -> bool:
    """Return whether an input fails; a vehicle that rolls down a slope is not an input."""
    return _settling(name for name in held if name != "not_stopping")


def _acked(inputs: Inputs) -> tuple[int, int]:
    if inputs.bumper is None:
        return 0, 0
    return inputs.bumper.value.boot, inputs.bumper.value.seq
