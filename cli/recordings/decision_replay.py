"""Replay of safety's decisions: its core, run again over the inputs of a recording. Pure.

``services.safety.core`` decides, unchanged. This module repeats what the shell around it does
(``services/safety/service.py``): it stores the newest samples, accepts requests, and decides at the
time of each recorded motion, and in between where the shell does.

**Start.** A recording may begin in the middle of a run. While the replay *follows*, it takes the
held causes, the source in control and the pending neutral request from each recorded state. It
compares from the time on at which each state of the last ``AGREED_NS`` was predicted from the one
before. It follows again after a gap in the motions, and when it disagrees for ``LOST_NS``.

**One step at a time.** Each decision continues from the recorded motion before it, so one
difference is counted once. If a motion does not come out, the messages of the last or the next
``UNSURE_NS`` may have arrived in another order: the replay tries that, and counts the motion as
*reordered*.

Derived from the recorded states, because calls and connections are not recorded:

===================== ==========================================================================
derived               from
===================== ==========================================================================
reset                 a latched cause that is gone
shutdown of safety    the cause ``leaving``
its lost connection   the cause ``estop_reader``, unless safety was stalled
===================== ==========================================================================

Unknown from before the recording: the budget of failures, the travel of a release, the sonars that
an operator overrides, and the readings that make a sonar suspect.
"""

from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from cli.recordings.safety_inputs import Run, Step
from common.freshness import NS_PER_S, Latest, fresh
from common.motion import BRAKE, RUN, STOP, Twist
from services.safety.config import DECISION_PERIOD_S, SafetyConfig
from services.safety.core.causes import BARRING, BY_NAME, LATCHING, Held, Latches
from services.safety.core.conditions import LOST_SAMPLES
from services.safety.core.inputs import DriveRequest, Inputs, LimitRequest
from services.safety.core.policy import Policy
from services.safety.core.state import State
from t2.messages import (
    Bumper,
    CauseName,
    Drive,
    Driver,
    Limit,
    Link,
    Mileage,
    Motion,
    Phrase,
    Phrases,
    ResetRequest,
    SafetyState,
    Switches,
    Ultrasonic,
    Velocity,
)

AGREED_NS = NS_PER_S // 2  # of states that agree, before motions are compared
LOST_NS = NS_PER_S  # of states that do not: the replay starts anew
TICK_NS = round(DECISION_PERIOD_S * NS_PER_S)
JITTER_NS = NS_PER_S // 333  # from a message to the motion that it causes
# A motion is stamped after its decision, up to 2 ms later, and the ramp goes on meanwhile.
CLOSE_MPS, CLOSE_RADPS = 0.003, 0.01
# Earlier and later arrivals that are tried when a motion does not come out, the nearest first: of
# the bridge's messages, and of the others.
SHIFTS_NS = tuple(
    (one * ms * 1_000_000, other * ms * 1_000_000)
    for ms in (1, 2, 5, 10, 20)
    for one in (0, -1, 1)
    for other in (0, -1, 1)
    if one or other
)
SEARCHES = 200  # without success; then the settings are the reason
FIELDS: dict[type, str] = {
    Velocity: "velocity",
    Mileage: "mileage",
    Ultrasonic: "ultrasonic",
    Bumper: "bumper",
    Switches: "switches",
    Link: "link",
}


class Decided(Struct, frozen=True):
    """One decision of the replay, at a recorded motion."""

    at_ns: int  # on safety's clock
    recorded: Motion
    motion: Motion
    before: State
    state: State
    inputs: Inputs
    is_compared: bool  # False while the replay follows the recorded states
    is_reordered: bool = False  # whether messages had to arrive in another order than sent

    @property
    def differences(self) -> tuple[str, ...]:
        """What differs from the recorded motion."""
        return differences(self.recorded, self.motion)


def differences(one: Motion, other: Motion) -> tuple[str, ...]:
    """Return the names of the fields in which two motions differ."""
    names = ("command", "source", "latched", "predecessor", "estop")
    found = [name for name in names if getattr(one, name) != getattr(other, name)]
    if abs(one.linear - other.linear) > CLOSE_MPS:
        found.append("linear")
    if abs(one.angular - other.angular) > CLOSE_RADPS:
        found.append("angular")
    return tuple(found)


class Moment(Struct, frozen=True):
    """The replay between two decisions; a value, so that another order can be tried."""

    state: State
    inputs: Inputs
    positions: tuple[int, int] = (0, 0)  # of the next steps, on the drive link and of the router
    shown: SafetyState | None = None  # the newest recorded state
    follows: bool = True
    agreed_ns: int | None = None  # since when recorded states agree; None while they do not
    differed_ns: int | None = None  # since when they do not
    tick_ns: int = 0  # of the newest regular decision
    sent_ns: int = 0  # of the newest motion


class Replay:
    """Replay of one run with the settings of its robot."""

    def __init__(self, settings: SafetyConfig, run: Run) -> None:
        self.policy = Policy(settings)
        self._times = settings.times
        self._run = run
        self._searches = SEARCHES

    def decisions(self) -> Iterator[Decided]:
        """Yield a decision for each recorded motion."""
        moment = Moment(self.policy.start(), Inputs(boot=self._run.boot, estop_connection=1))
        before: Motion | None = None
        for motion in self._run.motions:
            if before is not None and motion.seq != before.seq + 1:
                moment = _following(moment)
            moment, decided = self._best(moment, motion)
            yield decided
            moment = _after(moment, decided)
            before = motion

    def _best(self, moment: Moment, motion: Motion) -> tuple[Moment, Decided]:
        """Return the decision with the order of messages that leads to the recorded motion."""
        first = self._decide_at(moment, motion, (0, 0))
        if not first[1].differences or moment.follows or not self._searches:
            return first
        for shifts_ns in SHIFTS_NS:
            after, decided = self._decide_at(moment, motion, shifts_ns)
            if not decided.differences:
                return after, replace(decided, is_reordered=True)
        self._searches -= 1
        return first

    def _decide_at(
        self, moment: Moment, motion: Motion, shifts_ns: tuple[int, int]
    ) -> tuple[Moment, Decided]:
        """Decide after all messages until the motion, or until ``shifts_ns`` after it."""
        at_ns, tick_ns = motion.mono_ns, moment.tick_ns + TICK_NS
        # An urgent motion takes the place of a regular one, whose decision sends none.
        was_urgent = moment.sent_ns != moment.tick_ns
        has_silent = was_urgent and at_ns - tick_ns > TICK_NS // 2
        for step, positions in self._until(moment.positions, at_ns, shifts_ns):
            if has_silent and step.at_ns > tick_ns:
                has_silent, moment = False, self._silent(moment, tick_ns)
            is_due = at_ns - step.at_ns <= JITTER_NS  # this motion is decided on it
            moment = self._take(moment, step, min(step.at_ns, at_ns), is_due=is_due)
            moment = replace(moment, positions=positions)
        if has_silent:
            moment = self._silent(moment, tick_ns)
        decision = self.policy.decide(moment.state, moment.inputs, at_ns)
        decided = Decided(
            at_ns,
            motion,
            decision.motion,
            moment.state,
            decision.state,
            moment.inputs,
            is_compared=not moment.follows,
        )
        return moment, decided

    def _until(
        self, positions: tuple[int, int], at_ns: int, shifts_ns: tuple[int, int]
    ) -> Iterator[tuple[Step, tuple[int, int]]]:
        """Yield the next messages in the order of time, with the positions after each."""
        links = self._run.drive_link, self._run.router
        one, other = positions
        while True:
            nexts = [
                (links[n][at].at_ns, n)
                for n, at in enumerate((one, other))
                if at < len(links[n]) and links[n][at].at_ns <= at_ns + shifts_ns[n]
            ]
            if not nexts:
                return
            _, n = min(nexts)
            step = links[n][(one, other)[n]]
            one, other = one + (n == 0), other + (n == 1)
            yield step, (one, other)

    def _silent(self, moment: Moment, now_ns: int, reset: ResetRequest | None = None) -> Moment:
        """Decide without a motion."""
        inputs = replace(moment.inputs, reset=reset)
        state = self.policy.decide(moment.state, inputs, now_ns).state
        return replace(moment, state=state, inputs=replace(moment.inputs, estop=False))

    # --- messages -----------------------------------------------------------------------------

    def _take(self, moment: Moment, step: Step, now_ns: int, *, is_due: bool) -> Moment:
        """Return the moment after a message; ``is_due``: a recorded motion follows at once."""
        match step.message:
            case None:
                return self._take_estop(moment, now_ns, is_due=is_due)
            case SafetyState():
                return self._take_state(moment, step.message, now_ns, is_echo=step.is_echo)
            case Drive() | Limit():
                return self._accept(moment, step.name, step.message, now_ns)
            case Bumper():
                return self._take_bumper(moment, step.message, now_ns, is_due=is_due)
        name = FIELDS.get(type(step.message), step.name)  # a driver's is its side
        moment = _stored(moment, name, Latest(step.message, now_ns))
        if isinstance(step.message, Driver) and step.message.has_fault and not is_due:
            return self._silent(moment, now_ns)
        return moment

    def _accept(self, moment: Moment, source: str, message: Drive | Limit, now_ns: int) -> Moment:
        request = (
            DriveRequest(source, message, now_ns)
            if isinstance(message, Drive)
            else LimitRequest(source, message, now_ns)
        )
        state, _ = self.policy.accept(moment.state, request, now_ns)
        return replace(moment, state=state)

    def _take_estop(self, moment: Moment, now_ns: int, *, is_due: bool) -> Moment:
        moment = replace(moment, inputs=replace(moment.inputs, estop=True))
        urgent = "estop" not in moment.state.latches and not is_due
        return self._silent(moment, now_ns) if urgent else moment

    def _take_bumper(self, moment: Moment, bumper: Bumper, now_ns: int, *, is_due: bool) -> Moment:
        """Store a sample and decide as ``SafetyService._on_bumper`` does."""
        before = moment.inputs.bumper
        if before is not None and not fresh(before, now_ns, self._times.bumper_age):
            moment = self._silent(moment, now_ns)
        was_pressed = before is not None and before.value.pressed
        moment = _stored(moment, "bumper", Latest(bumper, now_ns))
        unjudged = bumper.seq - moment.state.verdict.judged[1]
        urgent = bumper.pressed != was_pressed or unjudged >= LOST_SAMPLES
        return self._silent(moment, now_ns) if urgent and not is_due else moment

    def _take_state(
        self, moment: Moment, shown: SafetyState, now_ns: int, *, is_echo: bool
    ) -> Moment:
        if is_echo:
            return _stored(moment, "estop_path", Latest(shown, now_ns))
        moment = self._derived(moment, shown, now_ns)
        moment = _compared(moment, shown, now_ns)
        if moment.follows:
            moment = replace(moment, state=_adopted(moment.state, shown, now_ns))
        heartbeat = moment.state.heartbeat.noted(shown.heartbeat, now_ns)
        state = replace(moment.state, heartbeat=heartbeat)
        return replace(moment, state=state, shown=shown)

    def _derived(self, moment: Moment, shown: SafetyState, now_ns: int) -> Moment:
        """Return the moment after what only this state shows: a reset, a shutdown, a connection."""
        names = {cause.name for cause in shown.causes}
        if "leaving" in names and not moment.inputs.leaving:
            return self._silent(
                replace(moment, inputs=replace(moment.inputs, leaving=True)), now_ns
            )
        if "estop_reader" in names and "estop_reader" not in moment.state.latches:
            connection = moment.inputs.estop_connection + 1
            inputs = replace(moment.inputs, estop_connection=connection)
            return self._silent(replace(moment, inputs=inputs), now_ns)
        gone = set(moment.shown.latched if moment.shown else ()).difference(shown.latched)
        held = moment.state.latches
        if cleared := tuple(held[name].id for name in gone if name in held):
            echo = moment.state.heartbeat.number
            return self._silent(moment, now_ns, ResetRequest(echo=echo, causes=cleared))
        return moment


def _stored(moment: Moment, name: str, latest: Latest[object]) -> Moment:
    return replace(moment, inputs=replace(moment.inputs, **{name: latest}))


def _following(moment: Moment) -> Moment:
    return replace(moment, follows=True, agreed_ns=None, differed_ns=None)


def _after(moment: Moment, decided: Decided) -> Moment:
    """Return the moment after a recorded motion; the next decision continues from it."""
    motion, state = decided.recorded, decided.state
    verdict = replace(
        state.verdict,
        command=motion.command,
        twist=Twist(motion.linear, motion.angular),
        judged=(motion.judged_boot, motion.judged),
    )
    state = replace(state, verdict=verdict)
    if moment.follows:
        state = _continued(state, motion)
    was_early = moment.tick_ns and decided.at_ns - moment.tick_ns < TICK_NS * 4 // 5
    return replace(
        moment,
        state=state,
        inputs=replace(decided.inputs, estop=False),
        tick_ns=moment.tick_ns if was_early else decided.at_ns,
        sent_ns=decided.at_ns,
    )


def _continued(state: State, motion: Motion) -> State:
    """Return the state with what only a motion shows: latched emergency stops, a rolling vehicle.

    Safety holds a vehicle that STOP did not hold by BRAKE.
    """
    standstill = state.motion.standstill
    if state.verdict.name in ("stop", "inhibited"):
        standstill = replace(standstill, rolls=motion.command is BRAKE)
    watch = replace(state.motion, standstill=standstill)
    return replace(state, estop=motion.estop, motion=watch)


def _compared(moment: Moment, shown: SafetyState, now_ns: int) -> Moment:
    """Return the moment after the comparison of its state with a recorded one."""
    verdict, latches = moment.state.verdict, moment.state.latches
    causes = {cause.name: cause.phrases for cause in shown.causes}
    starting = latches["starting"].phrases if "starting" in latches else ()
    agrees = (shown.verdict, shown.source, causes.keys(), _awaited(causes.get("starting", ()))) == (
        verdict.name, verdict.source, latches.keys(), _awaited(starting)
    )  # fmt: skip
    if not agrees:
        differed_ns = now_ns if moment.differed_ns is None else moment.differed_ns
        moment = replace(moment, agreed_ns=None, differed_ns=differed_ns)
        return _following(moment) if now_ns - differed_ns >= LOST_NS else moment
    agreed_ns = now_ns if moment.agreed_ns is None else moment.agreed_ns
    follows = moment.follows and now_ns - agreed_ns < AGREED_NS
    return replace(moment, agreed_ns=agreed_ns, differed_ns=None, follows=follows)


def _awaited(phrases: Phrases) -> set[object]:
    """Return the inputs without a first sample.

    Safety may have had a sample that is older than the recording. The recorder may have one that
    safety does not have: each of both subscribes on its own.
    """
    shown = [each.fields.get("inputs", ()) for each in phrases if each.name == "starting.missing"]
    return {name for names in shown if isinstance(names, tuple | list) for name in names}


def _adopted(state: State, shown: SafetyState, now_ns: int) -> State:
    """Return the state with the causes of a recorded one, and its neutral request."""
    latches: Latches = {
        cause.name: state.latches.get(cause.name)
        or Held(
            now_ns - round(cause.age * NS_PER_S),
            now_ns,
            0,
            (0, 0),
            cause.phrases or (Phrase(cause.name),),
            cause.id,
        )
        for cause in shown.causes
        if cause.name in BY_NAME
    }
    arbiter, source = state.arbiter, shown.source
    channel = arbiter.channels.get(source or "")
    if channel is not None and source is not None and BARRING.isdisjoint(latches):
        neutral_ns = None if "neutral" in latches else now_ns
        if arbiter.is_neutral(source) != (neutral_ns is not None):
            changed = replace(channel, neutral_ns=neutral_ns)
            arbiter = replace(arbiter, channels={**arbiter.channels, source: changed})
    verdict = replace(state.verdict, name=shown.verdict, source=source)
    return replace(state, latches=latches, arbiter=arbiter, verdict=verdict)


# --- other settings -----------------------------------------------------------------------------


class Variant:
    """What other settings would have decided at each decision of a replay, each one by itself.

    The vehicle of the recording did not react to these decisions. So each one begins at the state
    of the recorded run; only what safety makes of sonars and motion is carried on.
    """

    def __init__(self, settings: SafetyConfig) -> None:
        self._policy = Policy(settings)
        self._own = self._policy.start()

    def decide(self, decided: Decided) -> Motion:
        """Return the motion of these settings instead of a replayed one."""
        before, own = decided.before, self._own
        requests, limits = own.arbiter.sources, own.speed_limits.sources
        state = replace(
            before,
            arbiter=replace(
                before.arbiter,
                sources=requests,
                channels={k: v for k, v in before.arbiter.channels.items() if k in requests},
            ),
            speed_limits=replace(
                before.speed_limits,
                sources=limits,
                channels={k: v for k, v in before.speed_limits.channels.items() if k in limits},
            ),
            sonar_array=own.sonar_array,
            overrides=own.overrides,
            motion=own.motion,
        )
        decision = self._policy.decide(state, decided.inputs, decided.at_ns)
        self._own = decision.state
        return decision.motion


SEVERITY = {RUN: 0, STOP: 1, BRAKE: 2}


def new_stops(before: Decided | None, decided: Decided) -> tuple[CauseName, ...]:
    """Return the causes of a stop that begins with this decision, the worst first; or none.

    It begins when a motion ends, when a command becomes more severe, and when a cause latches.
    """
    held = decided.state.latches
    known = before.state.latches if before else {}
    latched = [name for name in held if name in LATCHING and name not in known]
    if before is None:
        return ()
    worse = SEVERITY[decided.motion.command] > SEVERITY[before.motion.command]
    if not worse and not latched:
        return ()
    stopping = [name for name in BY_NAME if name in held and BY_NAME[name].action != "slow"]
    return tuple(stopping)
