"""The decision: inputs and memory in, what the wheels may do out.

One pass, always in this order, so that a trip wins over whatever comes with it:

1. request   judge a request, if that is the event (``arbiter.py``)
2. sense     sonars, runaway, standstill, the board's counters, the way moved off the bumper
3. guard     observe every cause that does not depend on a wish (``conditions.py``)
4. answer    a reset or a held release, against what is held now
5. arm       note neutral requests while nothing asks for one, and who was overruled
6. move      ramp the wish and bend it to the zones (``motion.py``)
7. judge     the worst action of all that is held (``causes.py``)

RUN comes out of one place only, the end of ``_judge``: nothing held asks for STOP or BRAKE, and
there is a fresh wish.
"""

from collections.abc import Iterable

from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import Verdict as VerdictName
from common.motion import BRAKE, RUN, STILL, STOP, Command, Twist
from common.settings import Vehicle
from services.safety.arbiter import Arbiter
from services.safety.causes import BY_NAME, Clears, bars_motion, clears, wants_neutral
from services.safety.conditions import observe_inputs
from services.safety.config import Safety
from services.safety.inputs import Ask, Inputs
from services.safety.latches import Latches, Observation, latched, observe, ordered
from services.safety.motion import Plan, Planner, observations
from services.safety.operator_requests import answer, is_creeping
from services.safety.runaway import Bounds
from services.safety.sonar import Rules
from services.safety.sonar_array import Ears
from services.safety.standstill import Measured, Standstill, supervisor
from services.safety.state import RELEASE, State, Verdict

LONGEST_STEP_S = 0.1  # between two decisions; a stalled process must not leap
AGAINST_MPS = 0.1  # against the command, more than noise and lag
AGAINST_RADPS = 0.2


class Policy:
    """``decide`` with its settings and the vehicle's geometry; holds no state."""

    def __init__(self, settings: Safety, vehicle: Vehicle) -> None:
        self.settings = settings
        self.planner = Planner(settings, vehicle)
        rules = Rules(settings.hysteresis, settings.stuck_travel)
        self._ears = Ears(
            self.planner.zones, rules, settings.ultrasonic_age, self.planner.creep_room
        )
        self._supervisor = supervisor(settings)
        patience_s = settings.runaway_time
        self._linear = Bounds(
            settings.deceleration, settings.runaway_linear, AGAINST_MPS, patience_s
        )
        self._angular = Bounds(
            settings.angular_deceleration, settings.runaway_angular, AGAINST_RADPS, patience_s
        )

    def start(self) -> State:
        """Return the memory of a service that has just started."""
        return State(arbiter=Arbiter(self.settings.sources))

    def decide(self, state: State, inputs: Inputs, now_ns: int) -> tuple[State, Verdict]:
        """Return the new memory and the verdict; the event in the inputs is taken once."""
        step_s = min((now_ns - (state.decided_ns or now_ns)) / NS_PER_S, LONGEST_STEP_S)
        state = replace(state, decision=state.decision + 1)
        state, refused = self._request(state, inputs, now_ns)
        state = self._sense(state, inputs, step_s, now_ns)
        state = self._guard(state, inputs, now_ns)
        state, reply = answer(state, inputs, self.settings, now_ns)
        state = self._arm(state, now_ns)
        state, verdict = self._judge(state, inputs, step_s, now_ns)
        verdict = replace(verdict, refused=refused, reply=reply)
        return replace(state, decided_ns=now_ns, verdict=verdict), verdict

    def _request(self, state: State, inputs: Inputs, now_ns: int) -> tuple[State, str]:
        if not isinstance(inputs.event, Ask):
            return state, ""
        max_age_ns = round(self.settings.max_echo_age * NS_PER_S)
        arbiter, refused = state.arbiter.take(inputs.event, state.heartbeat, max_age_ns, now_ns)
        return replace(state, arbiter=arbiter), refused

    def _sense(self, state: State, inputs: Inputs, step_s: float, now_ns: int) -> State:
        settings, sent = self.settings, state.verdict
        known = inputs.known_velocity(now_ns, settings.velocity_age)
        measured = known or STILL
        heard = self._ears.hear(state.heard, inputs.ultrasonic, known, now_ns)
        trajectory, counter = state.trajectory, inputs.counter
        if inputs.mileage and counter:
            trajectory = trajectory.follow(counter, inputs.mileage.received_ns)
        release = state.release
        if "contact" in state.latches:
            moved = sent.twist if sent.source == RELEASE and sent.command is RUN else None
            reach = self.planner.reach
            release = release.moving(moved, known, counter, reach=reach, dt_s=step_s, now_ns=now_ns)
        return replace(
            state,
            heard=heard,
            linear=state.linear.follow(sent.twist.linear, measured.linear, step_s, self._linear),
            angular=state.angular.follow(
                sent.twist.angular, measured.angular, step_s, self._angular
            ),
            standstill=self._standstill(state, inputs, known, now_ns),
            release=release,
            trajectory=trajectory,
            reader_was_up=state.reader_was_up or inputs.reader,
        )

    def _standstill(
        self, state: State, inputs: Inputs, known: Twist | None, now_ns: int
    ) -> Standstill:
        sent, velocity = state.verdict, inputs.velocity
        commanded = sent.command is not RUN or sent.twist.rounds_to_zero
        latest = Latest(known, velocity.received_ns) if known and velocity else None
        seen = Measured(latest, inputs.mileage if inputs.counter else None)
        return self._supervisor.follow(state.standstill, commanded, seen, now_ns)

    def _guard(self, state: State, inputs: Inputs, now_ns: int) -> State:
        settle_ns = round(self.settings.settle * NS_PER_S)
        tick = (0, now_ns)
        bad_s = max(state.linear.bad_s, state.angular.bad_s)
        rivals = state.arbiter.rivals(now_ns)
        seen = [
            *observe_inputs(inputs, self.settings, state, now_ns),
            Observation("runaway", bad_s >= self.settings.runaway_time, tick),
            Observation("uncommanded_motion", state.standstill.left, tick),
            Observation(
                "not_stopping", state.standstill.is_late(now_ns), tick, state.standstill.text
            ),
            Observation("two_publishers", bool(rivals), tick, f"Two publishers ask on {rivals}."),
        ]
        held = observe(state.latches, seen, now_ns, settle_ns, state.decision)
        was_good, is_good = not _settling(state.latches), not _settling(held)
        credit = state.credit.after(now_ns, was_good and not is_good, is_good)
        flapping = Observation("flapping", credit.is_spent, tick)
        held = observe(held, [flapping], now_ns, decision=state.decision)
        release = state.release
        if "contact" in held:
            old = state.latches.get("contact")
            release = release.after(old, held["contact"], state.trajectory, now_ns)
            release = replace(release, unknown=release.unknown or "predecessor" in held)
        return replace(state, latches=held, credit=credit, release=release)

    def _arm(self, state: State, now_ns: int) -> State:
        arbiter = state.arbiter
        if state.heard.unseen or state.blind.since:
            operators = self.settings.operators & arbiter.asking_for_zero(now_ns)
            blind = state.blind.after(state.heard.unseen, operators, now_ns)
            state = replace(state, blind=blind)
        disarm = any(wants_neutral(name) for name in state.latches)
        arbiter = arbiter.disarmed() if disarm else arbiter.armed(now_ns)
        return replace(state, arbiter=arbiter.overruled(now_ns))

    def _judge(
        self, state: State, inputs: Inputs, step_s: float, now_ns: int
    ) -> tuple[State, Verdict]:
        creeping = is_creeping(state, inputs, self.settings, now_ns)
        suspended = {"contact"} if creeping else set()
        wish = self.planner.wish(state, creeping, now_ns)
        barred = _worst(_guards(state.latches) - suspended) != "run"
        plan = Plan()
        if wish and not barred:
            measured = inputs.known_velocity(now_ns, self.settings.velocity_age) or STILL
            plan = self.planner.plan(state, measured, wish, step_s)
        seen = observations(state, wish, plan, now_ns)
        held = observe(state.latches, seen, now_ns, decision=state.decision)
        state = replace(state, latches=held)
        worst = _worst(set(held) - suspended)
        command = _COMMANDS[worst]
        verdict = Verdict(
            name=_name(worst, held),
            command=command,
            twist=plan.twist if command is RUN else STILL,
            source=wish.source if wish else None,
            judged=_judged(inputs),
        )
        return state, verdict


_COMMANDS: dict[VerdictName, Command] = {
    "run": RUN,
    "slow": RUN,
    "stop": STOP,
    "brake": BRAKE,
}


def _worst(names: Iterable[str]) -> VerdictName:
    """Return the worst action of these causes, or to run when there are none."""
    first = next(iter(ordered(names)), None)
    return BY_NAME[first].action if first else "run"


def _name(worst: VerdictName, held: Latches) -> VerdictName:
    """Call a stop that waits for inputs or for a neutral request by its own name."""
    if worst != "stop" or latched(held):
        return worst
    return "inhibited" if _settling(held) or "neutral" in held else "stop"


def _guards(held: Latches) -> set[str]:
    """Return the causes that bar motion whatever is asked for."""
    return {name for name in held if bars_motion(name)}


def _settling(held: Latches) -> bool:
    return any(clears(name) is Clears.SETTLED for name in held)


def _judged(inputs: Inputs) -> tuple[int, int]:
    if inputs.bumper is None:
        return 0, 0
    return inputs.bumper.value.boot, inputs.bumper.value.seq
