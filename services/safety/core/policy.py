"""Policy: one decision, from inputs and state to the motion for the bridge.

Messages of sources are accepted or refused as they arrive (``arbiter.py``, ``speed_limits.py``).
Each decision takes these steps, always in this order, so that a trip wins over a reset that arrives
with it:

1. sense     update sonars, runaway, standstill and the travel of a release
2. observe   observe every cause that does not depend on a request (``conditions.py``); while one
             bars motion, a neutral request is due (``Arbiter.barred``)
3. handle    carry out a reset (``resets.py``)
4. arm       note which sources are overruled; begin, continue or end a release
             (``release_requests.py``)
5. conclude  plan the requested motion (``planning.py``), then apply the worst action
             (``causes.py``)

RUN has one origin: the end of ``_conclude``, when no held cause demands STOP or BRAKE and a fresh
request exists.
"""

from collections.abc import Iterable

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.motion import BRAKE, RUN, STILL, STOP
from services.safety.config import SafetyConfig
from services.safety.core.arbiter import Arbiter
from services.safety.core.causes import (
    BARRING,
    BY_NAME,
    FAILING,
    FLAPPING,
    OF_INPUTS,
    OF_REQUESTS,
    SETTLING,
    Latches,
    Observation,
    needs_reset,
    observe,
    ordered,
)
from services.safety.core.channel import Admission
from services.safety.core.conditions import observe_inputs, samples
from services.safety.core.inputs import DriveRequest, Inputs, SourceRequest
from services.safety.core.motion_watch import Supervisor
from services.safety.core.planning import Plan, Planner, observations
from services.safety.core.release_requests import answered
from services.safety.core.resets import carry_out
from services.safety.core.sonars import SonarFilter
from services.safety.core.speed_limits import SpeedLimits
from services.safety.core.state import State, Verdict
from t2.messages import CauseName, Command, Motion
from t2.messages import Verdict as VerdictName

SETTLE_NS = NS_PER_S // 2  # of good inputs until a cause clears
LONGEST_STEP_S = 0.1  # between two decisions; a stalled process must not skip ahead

COMMANDS: dict[VerdictName, Command] = {"run": RUN, "slow": RUN, "stop": STOP, "brake": BRAKE}


class Decision(Struct, frozen=True):
    """What a decision leads to."""

    state: State
    motion: Motion


class Policy:
    """Decides with the settings and the vehicle's geometry; holds no state."""

    def __init__(self, settings: SafetyConfig) -> None:
        self.settings = settings
        self.planner = Planner(settings)
        self._sonar_filter = SonarFilter(
            self.planner.zones.axes, settings.times.ultrasonic_age, self.planner.creep_room
        )
        self._supervisor = Supervisor(settings)

    def start(self) -> State:
        """Return the state of a service that has just started."""
        settings = self.settings
        return State(
            Arbiter(settings.leased),
            SpeedLimits(settings.safety.limits),
        )

    def accept(self, state: State, request: SourceRequest, now_ns: int) -> tuple[State, str]:
        """Accept a message of a source; return the reason of its refusal, empty when accepted."""
        settings = self.settings
        match request:
            case DriveRequest():
                arbiter = self._noting_rest(state, now_ns)
                checked = self._admission(state, settings.times.max_echo_age, now_ns)
                arbiter, refused = arbiter.accept(request, checked)
                return replace(state, arbiter=arbiter.overruled(now_ns)), refused
            case _:
                source = settings.safety.limits.get(request.source)
                # A sign of life is as old as its echo, and holds for the lease.
                age_s = source.lease if source and source.latches else settings.times.max_echo_age
                checked = self._admission(state, age_s, now_ns)
                limits, refused = state.speed_limits.accept(request, checked)
                arbiter = state.arbiter
                if not refused and limits.channels[request.source].stops:
                    arbiter = arbiter.barred(now_ns)  # also if it ends before the next decision
                state = replace(state, speed_limits=limits, arbiter=arbiter)
                return state, refused and f"limit_{refused}"

    def _admission(self, state: State, age_s: float, now_ns: int) -> Admission:
        return Admission(state.heartbeat, round(age_s * NS_PER_S), now_ns)

    def _noting_rest(self, state: State, now_ns: int) -> Arbiter:
        """Return the arbiter, which remembers when the vehicle last stood."""
        stands = state.motion.standstill.displacement.is_standing
        return state.arbiter.at_rest(now_ns) if stands else state.arbiter

    def decide(self, state: State, inputs: Inputs, now_ns: int) -> Decision:
        """Return the new state, and the motion for the bridge."""
        step_s = min((now_ns - (state.decided_ns or now_ns)) / NS_PER_S, LONGEST_STEP_S)
        state = replace(state, decision=state.decision + 1)
        state = self._sense(state, inputs, step_s, now_ns)
        state = self._observe(state, inputs, now_ns)
        reply = None
        if inputs.reset is not None:
            state, reply = carry_out(inputs.reset, state, inputs, self.settings, now_ns)
        state = self._arm(state, now_ns)
        state = replace(state, release=answered(state, inputs, self.settings, now_ns))
        state, verdict = self._conclude(state, inputs, step_s, now_ns)
        state = replace(
            state,
            decided_ns=now_ns,
            verdict=replace(verdict, reply=reply),
            estop_connection=inputs.estop_connection or state.estop_connection,
            estop=inputs.link.value.estop if inputs.link else None,
        )
        motion = _motion(verdict, inputs, state.estop, is_latched=needs_reset(state.latches))
        return Decision(state, motion)

    def _sense(self, state: State, inputs: Inputs, step_s: float, now_ns: int) -> State:
        sent, counters = state.verdict, inputs.mileage
        velocity = inputs.known_velocity(now_ns, self.settings.times.velocity_age)
        known = velocity.value if velocity else None
        release = state.release
        if "contact" in state.latches:
            release = release.moving(
                sent.twist if sent.command is RUN else None,  # only a release runs then
                known,
                counters.value if counters else None,
                reach=self.planner.reach,
                dt_s=step_s,
                now_ns=now_ns,
            )
        return replace(
            state,
            sonar_array=self._sonar_filter.update(
                state.sonar_array, inputs.ultrasonic, known, now_ns
            ),
            motion=self._supervisor.follow(
                state.motion, sent.twist, velocity, counters, step_s=step_s, now_ns=now_ns
            ),
            leg=state.leg.follow(counters) if counters else state.leg,
            release=release,
        )

    def _observe(self, state: State, inputs: Inputs, now_ns: int) -> State:
        seen = observe_inputs(inputs, self.settings, state, now_ns)
        held = observe(
            state.latches,
            seen,
            OF_INPUTS,
            now_ns,
            samples=samples(inputs),
            settle_ns=SETTLE_NS,
            decision=state.decision,
        )
        was_good, is_good = FAILING.isdisjoint(state.latches), FAILING.isdisjoint(held)
        budget = state.fault_budget.updated(now_ns, was_good and not is_good, is_good)
        flapping = [Observation("flapping")] if budget.is_spent else []
        held = observe(held, flapping, FLAPPING, now_ns, decision=state.decision)
        release = state.release
        if "contact" in held:
            release = release.after(
                state.latches.get("contact"), held["contact"], state.leg, now_ns
            )
            release = replace(release, unknown=release.unknown or "predecessor" in held)
        arbiter = state.arbiter if BARRING.isdisjoint(held) else state.arbiter.barred(now_ns)
        return replace(state, latches=held, fault_budget=budget, release=release, arbiter=arbiter)

    def _arm(self, state: State, now_ns: int) -> State:
        arbiter, overrides = self._noting_rest(state, now_ns), state.overrides
        if state.sonar_array.unseen or overrides.since:
            neutral = {
                name: arbiter.channels[name].neutral_ns or 0
                for name in self.settings.safety.operators & arbiter.requesting_zero(now_ns)
            }
            overrides = overrides.updated(state.sonar_array.unseen, neutral, now_ns)
        return replace(state, arbiter=arbiter.overruled(now_ns), overrides=overrides)

    def _conclude(
        self, state: State, inputs: Inputs, step_s: float, now_ns: int
    ) -> tuple[State, Verdict]:
        # A release moves the vehicle although the contact is latched.
        ignored = {"contact"} if state.release.direction else set()
        requested = self.planner.requested(state, now_ns)
        plan = Plan()
        if requested and (BARRING & state.latches.keys()) <= ignored:
            known = inputs.known_velocity(now_ns, self.settings.times.velocity_age)
            measured = known.value if known else STILL
            plan = self.planner.plan(state, measured, requested, step_s)
        seen = observations(state, requested, plan)
        held = observe(state.latches, seen, OF_REQUESTS, now_ns, decision=state.decision)
        worst = _worst(held.keys() - ignored)
        command = COMMANDS[worst]
        # The verdict's name stays "stop": the cause of it only stops, and the vehicle rolls.
        if command is STOP and state.motion.standstill.rolls:
            command = BRAKE
        source = requested.source if requested else None
        return replace(state, latches=held), Verdict(
            name=_name(worst, held),
            command=command,
            twist=plan.twist if command is RUN else STILL,
            source=source,
            control=source if source and BARRING.isdisjoint(held) else None,
            judged=_judged(inputs),
            limited_by=requested.limited_by if requested else None,
            slowed_by=plan.slowed_by,
            blocked_by=plan.blocked_by,
        )


def _motion(verdict: Verdict, inputs: Inputs, estop: int | None, *, is_latched: bool) -> Motion:
    """Return the message of a verdict on these inputs."""
    return Motion(
        command=verdict.command,
        linear=verdict.twist.linear,
        angular=verdict.twist.angular,
        source=verdict.source,
        judged=verdict.judged[1],
        judged_boot=verdict.judged[0],
        latched=is_latched,
        predecessor=inputs.link.value.latched_by if inputs.link else None,
        estop=estop,
    )


def _worst(names: Iterable[CauseName]) -> VerdictName:
    """Return the worst action of these causes; "run" without any."""
    held = ordered(names)
    return BY_NAME[held[0]].action if held else "run"


def _name(worst: VerdictName, held: Latches) -> VerdictName:
    """Return the verdict's name: "inhibited" while inputs or a neutral request are due."""
    if worst != "stop" or needs_reset(held):
        return worst
    return "inhibited" if "neutral" in held or not SETTLING.isdisjoint(held) else "stop"


def _judged(inputs: Inputs) -> tuple[int, int]:
    if inputs.bumper is None:
        return 0, 0
    return inputs.bumper.value.boot, inputs.bumper.value.seq
