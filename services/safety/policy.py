"""The decision: inputs and memory in, what the wheels may do out.

One pass, always in this order, so that a trip wins over whatever comes with it:

1. request   judge a request, if that is the event (``arbiter.py``)
2. sense     sonars, runaway, the way crept off the bumper
3. guard     observe every cause that does not depend on a wish (``conditions.py``)
4. answer    a reset or a held release, against what is held now
5. arm       note neutral requests while nothing asks for one
6. move      ramp the wish and bend it to the zones (``motion.py``)
7. judge     the worst action of all that is held (``causes.py``)

RUN comes out of one place only, the end of ``_judge``: nothing held asks for STOP or BRAKE, and
there is a fresh wish.
"""

from collections.abc import Iterable

from msgspec.structs import replace

from common.freshness import S
from common.messages import Command
from common.messages import Verdict as VerdictName
from common.settings import Vehicle
from services.safety.answers import answer, is_creeping
from services.safety.arbiter import Arbiter
from services.safety.causes import BY_NAME, Clears, clears, wants_neutral
from services.safety.conditions import observe_inputs
from services.safety.config import Safety
from services.safety.ears import Ears
from services.safety.inputs import Ask, Inputs
from services.safety.latches import GOOD_SAMPLES, Latches, Observation, latched, observe, ordered
from services.safety.motion import Plan, Planner, observations
from services.safety.release import Release
from services.safety.runaway import Bounds
from services.safety.sonar import Rules
from services.safety.state import RELEASE, State, Verdict
from services.safety.twist import STILL

LONGEST_STEP_S = 0.1  # between two decisions; a stalled process must not leap
AGAINST_MPS = 0.1  # against the command, more than noise and lag
AGAINST_RADPS = 0.2


class Policy:
    """``decide`` with its settings and the vehicle's geometry; holds no state."""

    def __init__(self, settings: Safety, vehicle: Vehicle) -> None:
        self.settings = settings
        self.planner = Planner(settings, vehicle)
        rules = Rules(settings.hysteresis, settings.stuck_travel)
        self._ears = Ears(self.planner.zones, rules, settings.ultrasonic_age)
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
        step_s = min((now_ns - (state.decided_ns or now_ns)) / S, LONGEST_STEP_S)
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
        max_age_ns = round(self.settings.max_echo_age * S)
        arbiter, refused = state.arbiter.take(inputs.event, state.heartbeat, max_age_ns, now_ns)
        return replace(state, arbiter=arbiter), refused

    def _sense(self, state: State, inputs: Inputs, step_s: float, now_ns: int) -> State:
        settings, sent = self.settings, state.verdict
        known = inputs.known_velocity(now_ns, settings.velocity_age)
        measured = known or STILL
        heard = self._ears.hear(state.heard, inputs.ultrasonic, known, now_ns)
        release = state.release
        if "contact" in state.latches and sent.source == RELEASE:
            release = release.crept(sent.twist, measured, self.planner.reach, step_s)
        return replace(
            state,
            heard=heard,
            linear=state.linear.follow(sent.twist.linear, measured.linear, step_s, self._linear),
            angular=state.angular.follow(
                sent.twist.angular, measured.angular, step_s, self._angular
            ),
            release=release,
            moved=state.moved if measured.is_standing else measured,
            reader_was_up=state.reader_was_up or inputs.reader,
        )

    def _guard(self, state: State, inputs: Inputs, now_ns: int) -> State:
        settle_ns = round(self.settings.settle * S)
        tick = (0, now_ns)
        bad_s = max(state.linear.bad_s, state.angular.bad_s)
        rivals = state.arbiter.rivals(now_ns)
        seen = [
            *observe_inputs(inputs, self.settings, state, now_ns),
            Observation("runaway", bad_s >= self.settings.runaway_time, tick),
            Observation("two_publishers", bool(rivals), tick, f"Two publishers ask on {rivals}."),
        ]
        held = observe(state.latches, seen, now_ns, settle_ns)
        was_good, is_good = not _settling(state.latches), not _settling(held)
        credit = state.credit.after(now_ns, was_good and not is_good, is_good)
        held = observe(held, [Observation("flapping", credit.is_spent, tick)], now_ns)
        release = _press(state, inputs)
        return replace(state, latches=held, credit=credit, release=release)

    def _arm(self, state: State, now_ns: int) -> State:
        arbiter = state.arbiter
        disarm = any(wants_neutral(name) for name in state.latches)
        return replace(state, arbiter=arbiter.disarmed() if disarm else arbiter.armed(now_ns))

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
        seen = observations(state, wish, plan, barred, now_ns)
        held = observe(state.latches, seen, now_ns)
        state = replace(state, latches=held)
        worst = _worst(set(held) - suspended)
        command: Command = "run" if worst in ("run", "slow") else _COMMANDS[worst]
        verdict = Verdict(
            name=_name(worst, held),
            command=command,
            twist=plan.twist if command == "run" else STILL,
            source=wish.source if wish else None,
            judged=_judged(inputs),
        )
        return state, verdict


_COMMANDS: dict[str, Command] = {"stop": "stop", "brake": "brake"}


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
    return {name for name in held if wants_neutral(name) or name == "two_publishers"}


def _settling(held: Latches) -> bool:
    return any(clears(name) is Clears.SETTLED for name in held)


def _press(state: State, inputs: Inputs) -> Release:
    """Return a new release when the bumper is pressed anew, else the one that there is."""
    if inputs.bumper is None or not inputs.bumper.value.pressed:
        return state.release
    old = state.latches.get("contact")
    if old is not None and old.good < GOOD_SAMPLES:
        return state.release
    return Release(before=state.moved)


def _judged(inputs: Inputs) -> tuple[int, int]:
    if inputs.bumper is None:
        return 0, 0
    return inputs.bumper.value.boot, inputs.bumper.value.seq
