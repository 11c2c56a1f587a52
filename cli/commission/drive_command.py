"""``t2 checkout drive``: the guided drive on the ground, beside a running recorder."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from cli.commission.drive_verdict import (
    Drive,
    Result,
    judge_drive,
    judge_standstill,
    recorder_problem,
    switches_problem,
    writing_recorders,
)
from cli.commission.manoeuvres import (
    Group,
    Manoeuvre,
    announcement,
    homing,
    missing_stops,
    plan,
)
from cli.commission.report import Report, Verdict, after
from cli.commission.session import SOURCE, CheckoutSession
from cli.commission.steps import (
    choice,
    confirm,
    is_phrase,
    prompt,
    reported,
    show,
    unlatch,
)
from cli.commission.texts import Say
from common.config import build
from common.motion import Twist
from common.standstill import stopping_s
from services.safety.config import SafetyConfig
from t2 import keys
from t2.errors import T2Error
from t2.messages import Mileage

CONFIRMS = 2  # attempts to type the phrase
RECORDER_S = 3.0  # of health messages, one a second
SWITCHES_S = 3.0
COUNTERS_S = 2.0
TURNED_DEG = 10.0  # from the first heading: the way back is another one
MOTION = 3  # figures of a motion: commanded, measured, counted
PATIENCE_S = 3.0  # for a stop, on top of what the settings reckon with


@dataclass(slots=True)
class GuidedDrive:
    """The manoeuvres with the operator, on the running stack."""

    session: CheckoutSession
    report: Report
    settings: SafetyConfig
    fastest: Twist = field(default_factory=lambda: Twist(math.inf, math.inf))  # on each axis
    under_way: str = ""  # title of the manoeuvre
    space_m: float = math.inf  # free ahead and behind
    limited: str = ""  # why nothing is faster
    recorders: frozenset[int] = frozenset()  # ``boot`` of those that write everything
    unrecorded: bool = False  # whether the operator drives without a recording

    def begin(self) -> None:
        """Check what the drive needs; raise ``T2Error`` unless it may begin."""
        say = self.session.say
        show(say("drive.warning"))
        self._check_switches()
        self._check_recorder()
        if problem := unlatch(self.session):
            raise T2Error(problem)
        if not any(confirm(say("drive.ground"), "ground", say) for _ in range(CONFIRMS)):
            raise T2Error(say("drive.not_confirmed"))

    def run(self, manoeuvres: Sequence[Manoeuvre], *, returns: bool) -> None:
        """Carry out the manoeuvres, and drive back to the beginning.

        Ctrl-C is an emergency stop at any moment, in a question too.
        """
        try:
            self._run(manoeuvres, returns=returns)
        except KeyboardInterrupt:
            self._interrupted()
            raise

    def _interrupted(self) -> None:
        """Publish an emergency stop, and report whether safety has latched it."""
        say = self.session.say
        is_latched = self.session.emergency_stop()
        text = say("drive.interrupted", causes=say.causes(self.session.latched()))
        hint = say("drive.reset_hint")
        if not is_latched:
            text += f"{say('drive.and')}{say('drive.not_latched')}"
            hint = say("drive.own_switch")
        self.report.aborted = text
        ended = say("drive.ended", text=text)
        if self.under_way:
            self.report.manoeuvres.append((self.under_way, Verdict("failed", ended)))
        show(f"\n{say.sentences([ended, hint])}")

    def _run(self, manoeuvres: Sequence[Manoeuvre], *, returns: bool) -> None:
        start = self._counters()
        total = len(manoeuvres) + returns
        numbered = enumerate(manoeuvres, 1)
        done = [it for number, it in numbered if self._step(it, f"[{number}/{total}]")]
        if returns and (back := self._way_back(start)):
            self._step(back, f"[{total}/{total}]")
        self._check_recorder()
        if missing := missing_stops(done, manoeuvres, self.session.say):
            show(f"\n{self.session.say('drive.missing', stops='; '.join(missing))}")
        show(self.session.say("drive.over"))

    def _step(self, it: Manoeuvre, number: str) -> bool:
        """Carry out a manoeuvre, or skip it; return whether it went as expected.

        Raise ``T2Error`` if the drive must end.
        """
        if it.is_faster(self.fastest):
            omitted = self.session.say("drive.omitted", why=self.limited)
            result = Result(Verdict("skipped", omitted))
            left_out = self.session.say("drive.left_out", title=it.title, why=self.limited)
            show(f"{number} {left_out}")
        else:
            show(f"\n{number} {it.title}\n{announcement(it, self.session.say)}")
            self.under_way = it.title
            result = self._with_operator(it)
            self.under_way = ""
        self.report.manoeuvres.append((it.title, result.verdict))
        if result.verdict.outcome == "failed" and result.then == "end":
            raise T2Error(f"{it.title}: {result.verdict.text}")
        if result.verdict.outcome == "failed" and result.then == "slower":
            self._limit(it)
        return result.verdict.outcome == "passed"

    def _with_operator(self, it: Manoeuvre) -> Result:
        """Return the result that the operator accepts."""
        say = self.session.say
        if reason := choice(say("begin")):
            return Result(Verdict("skipped", reason))
        earlier: list[Verdict] = []
        while True:
            result = self._attempt(it)
            outcome = say(f"verdict.{result.verdict.outcome}")
            text = say("found", outcome=outcome, text=result.verdict.text)
            show(f"{text}{_figures(result.verdict, say)}")
            is_over = result.verdict.outcome == "passed" or result.then != "again"
            if is_over or choice(say("any_word")):
                return Result(after(result.verdict, earlier, say), result.then)
            earlier.append(result.verdict)

    def _attempt(self, it: Manoeuvre) -> Result:
        if not self._is_recorded():
            self._check_recorder()
        was_latched = bool(self.session.fresh_state().latched)
        if problem := unlatch(self.session):
            return Result(Verdict("failed", problem))
        # The operator has confirmed the reset, not the motion.
        if was_latched:
            show(f"\n{it.title}\n{announcement(it, self.session.say)}")
        if was_latched and (reason := choice(self.session.say("begin"))):
            return Result(Verdict("skipped", reason), "slower")
        if it.twist.is_zero:
            return judge_standstill(self.session.observe(it))
        source = self.settings.leased.get(SOURCE)
        body = self.settings.vehicle
        stop_s = stopping_s(it.twist, body.deceleration, body.angular_deceleration)
        drive = self.session.perform(
            it, source.lease if source else 0.0, self.settings.reaction + stop_s + PATIENCE_S
        )
        if drive is None:
            why = self.session.say("drive.not_granted", text=reported(self.session))
            return Result(Verdict("failed", why))
        result, latched = judge_drive(drive, self.settings), self._latch_after(drive)
        if not latched:
            return result
        before = f"{result.verdict.text} " if result.verdict.outcome == "failed" else ""
        text = before + self.session.say("drive.stays", why=latched)
        return Result(Verdict("failed", text, result.verdict.data), result.then)

    def _latch_after(self, drive: Drive) -> str:
        """Reset the emergency stop of a planned BRAKE; return why one stays latched, or nothing."""
        if not self.session.has_braked:
            return ""
        if drive.problem is None and drive.stood and drive.manoeuvre.ending == "brake":
            return self.session.reset_own_stop()
        return self.session.say("drive.unplanned")

    def _limit(self, it: Manoeuvre) -> None:
        """Leave out everything that is faster than this motion on its axes."""
        linear, angular = abs(it.twist.linear) or math.inf, abs(it.twist.angular) or math.inf
        self.fastest = Twist(min(self.fastest.linear, linear), min(self.fastest.angular, angular))
        self.limited = self.session.say("drive.faster", title=it.title)

    def _way_back(self, start: Mileage) -> Manoeuvre | None:
        end, say = self._counters(), self.session.say
        if (start.boot, start.epoch) != (end.boot, end.epoch):
            show(f"\n{say('drive.counters')}")
            return None
        travelled = end.distance - start.distance
        turned = abs(math.remainder(end.heading - start.heading, math.tau))
        back = homing(travelled, self.settings, say)
        reason = ""
        if back is None:
            show(f"\n{say('drive.where', distance=abs(travelled))}")
        elif turned > math.radians(TURNED_DEG):
            reason = say("drive.turned", degrees=math.degrees(turned))
        elif back.ahead > self.space_m:
            reason = say("drive.return_needs", distance=back.ahead)
        if not reason:
            return back
        show(f"\n{say('drive.no_return', distance=abs(travelled), reason=reason)}")
        self.report.left_out = [*self.report.left_out, say("drive.return", reason=reason)]
        return None

    # --- conditions to begin --------------------------------------------------------------------

    def _check_switches(self) -> None:
        log = self.session.of(keys.SWITCHES)
        while True:
            self.session.mark()
            self.session.until(lambda: log, SWITCHES_S)
            problem = switches_problem(log[-1].value if log else None, self.session.say)
            if not problem:
                return
            show(problem)
            if prompt(self.session.say("check_again")):
                raise T2Error(problem)

    def _check_recorder(self) -> None:
        """Find the recorders that write everything; the operator may do without."""
        while not self.unrecorded:
            self.session.mark()
            self.session.listen(RECORDER_S)
            health = [one.value for one in self.session.of(keys.HEALTH)]
            velocities = self.session.of(keys.VELOCITY)
            host = velocities[-1].value.host if velocities else 0
            problem = recorder_problem(health, host, self.session.say)
            if not problem:
                self.recorders = frozenset(writing_recorders(health))
                return
            say = self.session.say
            show(say("drive.unrecorded", problem=problem))
            typed = prompt(say("drive.unrecorded_ask", phrase=say("phrase.unrecorded")))
            if is_phrase(typed, "unrecorded"):
                about = say("drive.no_recording", problem=problem)
                self.report.facts.append((say.figure("recording"), about))
                self.unrecorded, self.recorders = True, frozenset()
            elif typed:
                raise T2Error(problem)

    def _is_recorded(self) -> bool:
        """Return whether one of the recorders writes from now on."""
        self.session.mark()
        health = self.session.of(keys.HEALTH)
        return self.unrecorded or self.session.until(
            lambda: not self.recorders.isdisjoint(writing_recorders(one.value for one in health)),
            RECORDER_S,
        )

    def _counters(self) -> Mileage:
        self.session.mark()
        log = self.session.of(keys.MILEAGE)
        if not self.session.until(lambda: log, COUNTERS_S):
            raise T2Error("no counters are received: run `t2 checkout --only link`")
        return log[-1].value


def guided_drive(
    report: Report, session: CheckoutSession, only: Sequence[Group], space_m: float
) -> None:
    """Carry out the manoeuvres of these groups that need at most this space straight on."""
    settings = build(SafetyConfig, session.settings("safety"))
    planned = plan(settings, session.say)
    wanted = [it for it in planned if not only or it.group in only]
    manoeuvres = [it for it in wanted if it.ahead <= space_m]
    if left_out := len(planned) - len(manoeuvres):
        report.left_out = [session.say("drive.excluded", count=left_out)]
    report.planned = [it.title for it in manoeuvres]
    drive = GuidedDrive(session, report, settings, space_m=space_m)
    drive.begin()
    drive.run(manoeuvres, returns=not only or "return" in only)


def _figures(verdict: Verdict, say: Say) -> str:
    """Return the figures of a verdict as lines below it: of the motion, and of its stop."""
    texts = [f"{say.figure(name)} {text}" for name, text in verdict.data]
    return "".join(f"\n  {', '.join(part)}" for part in (texts[:MOTION], texts[MOTION:]) if part)
