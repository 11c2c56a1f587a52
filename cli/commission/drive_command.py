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
from cli.commission.report import Report, Verdict
from cli.commission.session import SOURCE, CheckoutSession
from cli.commission.steps import (
    GROUND_PHRASE,
    choice,
    confirm,
    prompt,
    reported,
    show,
    unlatch,
)
from common.config import build
from common.motion import Twist
from common.standstill import stopping_s
from services.safety.config import SafetyConfig
from t2 import keys
from t2.errors import T2Error
from t2.messages import Mileage

UNRECORDED = "without a recording"
RECORDER_S = 3.0  # of health messages, one a second
SWITCHES_S = 3.0
COUNTERS_S = 2.0
TURNED_DEG = 10.0  # from the first heading: the way back is another one
MOTION = 3  # figures of a motion: commanded, measured, counted
PATIENCE_S = 3.0  # for a stop, on top of what the settings reckon with
RESET_HINT = "The next motion asks you for its reset; `t2 drive` can reset it, too."
WARNING = (
    "The vehicle drives on the ground. Hold the vehicle's own stop switch, and keep everybody away "
    "from it.\nMark its place on the ground. Each motion is announced with the free space that it "
    "needs.\nSTOP: the checkout stops publishing, and its lease ends. BRAKE: it publishes an "
    "emergency stop, and resets it.\nSlow down: it requests zero. Ctrl-C is an emergency stop, and "
    "ends the drive."
)


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
        show(WARNING)
        self._check_switches()
        self._check_recorder()
        if problem := unlatch(self.session):
            raise T2Error(problem)
        if not confirm("All wheels stand on the ground, and the space is free.", GROUND_PHRASE):
            raise T2Error("not confirmed: no motion was requested")

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
        is_latched = self.session.emergency_stop()
        latched = ", ".join(self.session.latched()) or "nothing"
        text = f"interrupted by the operator, by an emergency stop; safety has latched: {latched}"
        hint = "Reset it with `t2 drive`."
        if not is_latched:
            text += "; the emergency stop is NOT CONFIRMED"
            hint = "Stop the vehicle with its own switch."
        self.report.aborted = text
        if self.under_way:
            verdict = Verdict("failed", f"Ended: {text}.")
            self.report.manoeuvres.append((self.under_way, verdict))
        show(f"\nEnded: {text}. {hint}")

    def _run(self, manoeuvres: Sequence[Manoeuvre], *, returns: bool) -> None:
        start = self._counters()
        total = len(manoeuvres) + returns
        numbered = enumerate(manoeuvres, 1)
        done = [it for number, it in numbered if self._step(it, f"[{number}/{total}]")]
        if returns and (back := self._way_back(start)):
            self._step(back, f"[{total}/{total}]")
        self._check_recorder()
        if missing := missing_stops(done, manoeuvres):
            show(f"\nStops that are still missing for a fit: {'; '.join(missing)}.")
        show("The drive is over. End `t2 record` with Ctrl-C.")

    def _step(self, it: Manoeuvre, number: str) -> bool:
        """Carry out a manoeuvre, or skip it; return whether it went as expected.

        Raise ``T2Error`` if the drive must end.
        """
        if it.is_faster(self.fastest):
            result = Result(Verdict("skipped", f"Left out: {self.limited}"))
            show(f"{number} {it.title}: left out, {self.limited}")
        else:
            show(f"\n{number} {it.title}\n{announcement(it)}")
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
        if reason := choice("Press Enter to begin, or type a reason to skip:"):
            return Result(Verdict("skipped", reason))
        while True:
            result = self._attempt(it)
            show(f"{result.verdict.outcome}: {result.verdict.text}{_figures(result.verdict)}")
            if result.verdict.outcome == "passed" or result.then != "again":
                return result
            if choice("Press Enter to try again, or type any word to continue:"):
                return result

    def _attempt(self, it: Manoeuvre) -> Result:
        if not self._is_recorded():
            self._check_recorder()
        if problem := unlatch(self.session):
            return Result(Verdict("failed", problem))
        if it.twist.is_zero:
            return judge_standstill(self.session.observe(it))
        source = self.settings.leased.get(SOURCE)
        body = self.settings.vehicle
        stop_s = stopping_s(it.twist, body.deceleration, body.angular_deceleration)
        drive = self.session.perform(
            it, source.lease if source else 0.0, self.settings.reaction + stop_s + PATIENCE_S
        )
        if drive is None:
            why = reported(self.session)
            return Result(Verdict("failed", f"Safety does not grant motion. It reports: {why}"))
        result, latched = judge_drive(drive, self.settings), self._latch_after(drive)
        if not latched:
            return result
        before = f"{result.verdict.text} " if result.verdict.outcome == "failed" else ""
        text = f"{before}The emergency stop stays latched. {latched} {RESET_HINT}"
        return Result(Verdict("failed", text, result.verdict.data), result.then)

    def _latch_after(self, drive: Drive) -> str:
        """Reset the emergency stop of a planned BRAKE; return why one stays latched, or nothing."""
        if not self.session.has_braked:
            return ""
        if drive.problem is None and drive.stood and drive.manoeuvre.ending == "brake":
            return self.session.reset_own_stop()
        return "It was not planned: find out why."

    def _limit(self, it: Manoeuvre) -> None:
        """Leave out everything that is faster than this motion on its axes."""
        linear, angular = abs(it.twist.linear) or math.inf, abs(it.twist.angular) or math.inf
        self.fastest = Twist(min(self.fastest.linear, linear), min(self.fastest.angular, angular))
        self.limited = f"faster than {it.title}, which failed."

    def _way_back(self, start: Mileage) -> Manoeuvre | None:
        end = self._counters()
        if (start.boot, start.epoch) != (end.boot, end.epoch):
            show("\nThe counters have started again, so the way back is unknown.")
            return None
        travelled = end.distance - start.distance
        turned = abs(math.remainder(end.heading - start.heading, math.tau))
        back = homing(travelled, self.settings)
        where = f"By its counters it stands {abs(travelled):.2f} m from where it began"
        reason = ""
        if back is None:
            show(f"\n{where}.")
        elif turned > math.radians(TURNED_DEG):
            reason = f"turned by {math.degrees(turned):.0f} degrees"
        elif back.ahead > self.space_m:
            reason = f"its way back needs {back.ahead:.1f} m"
        if not reason:
            return back
        show(f"\n{where}, {reason}: the return is left out. Drive it back with `t2 drive`.")
        self.report.left_out = [*self.report.left_out, f"the return ({reason})"]
        return None

    # --- conditions to begin --------------------------------------------------------------------

    def _check_switches(self) -> None:
        log = self.session.of(keys.SWITCHES)
        while True:
            self.session.mark()
            self.session.until(lambda: log, SWITCHES_S)
            problem = switches_problem(log[-1].value if log else None)
            if not problem:
                return
            show(problem)
            if prompt("Press Enter to check again, or type any word to end:"):
                raise T2Error(problem)

    def _check_recorder(self) -> None:
        """Find the recorders that write everything; the operator may do without."""
        while not self.unrecorded:
            self.session.mark()
            self.session.listen(RECORDER_S)
            health = [one.value for one in self.session.of(keys.HEALTH)]
            velocities = self.session.of(keys.VELOCITY)
            host = velocities[-1].value.host if velocities else 0
            problem = recorder_problem(health, host)
            if not problem:
                self.recorders = frozenset(writing_recorders(health))
                return
            show(f"NOT RECORDED: {problem}")
            typed = prompt(
                f'Press Enter to check again, type "{UNRECORDED}" to go on all the same, or any '
                "other text to end:"
            )
            if typed.casefold() == UNRECORDED:
                self.report.facts.append(("recording", f"none: {problem}"))
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
    wanted = [it for it in plan(settings) if not only or it.group in only]
    manoeuvres = [it for it in wanted if it.ahead <= space_m]
    if left_out := len(plan(settings)) - len(manoeuvres):
        report.left_out = [f"{left_out} manoeuvres by --only or --space"]
    drive = GuidedDrive(session, report, settings, space_m=space_m)
    drive.begin()
    drive.run(manoeuvres, returns=not only or "return" in only)


def _figures(verdict: Verdict) -> str:
    """Return the figures of a verdict as lines below it: of the motion, and of its stop."""
    texts = [f"{name} {text}" for name, text in verdict.data]
    return "".join(f"\n  {', '.join(part)}" for part in (texts[:MOTION], texts[MOTION:]) if part)
