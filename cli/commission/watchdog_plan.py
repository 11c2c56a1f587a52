"""Test plan of the board's own command watchdog: commands over time, and the verdict. Pure.

::

    RUN at 20 Hz, 1 s ──> nothing ──> BRAKE at 20 Hz until standstill
                          at most 1 s, or until standstill

A silent board, or a speed beyond the request, ends the first two phases at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from cli.commission.report import Verdict
from common.freshness import NS_PER_S, Latest
from common.motion import STILL, Twist
from common.wire.commands import MotionCommand, MotionKind

LINEAR_MPS = 0.05
RUN_NS = NS_PER_S
SILENCE_NS = NS_PER_S
PERIOD_NS = NS_PER_S // 20
SILENT_NS = NS_PER_S // 5  # without a velocity the motion is not observed, and ends
TOO_FAST_MPS = 0.2
MOVING_MPS = 0.03  # above the standstill limit of 0.02: the board has obeyed RUN
STANDS_NS = NS_PER_S // 5  # duration that counts as standstill

RUN = MotionCommand(MotionKind.RUN, round(LINEAR_MPS * 1000))
BRAKE = MotionCommand(MotionKind.BREAK)

Phase = Literal["run", "silence", "brake", "over"]
Sample = Latest[Twist]  # a velocity of the board, with its local receive time


@dataclass(frozen=True, slots=True)
class WatchdogPlan:
    """State of the test; a new one begins with RUN."""

    begun_ns: int
    phase: Phase = "run"
    sent_ns: int | None = None  # time of the newest command
    last_run_ns: int | None = None
    braked_ns: int | None = None  # when BRAKE began
    abort: str = ""  # reason of an early end
    samples: tuple[Sample, ...] = ()
    stood_ns: int | None = None  # start of the standstill

    def add(self, sample: Sample) -> "WatchdogPlan":
        """Return the plan after one velocity of the board."""
        stood_ns = (self.stood_ns or sample.received_ns) if sample.value.is_standing else None
        return replace(self, samples=(*self.samples, sample), stood_ns=stood_ns)

    def end(self, reason: str, now_ns: int) -> "WatchdogPlan":
        """Return the plan with BRAKE from now on; no change if it brakes already."""
        if self.phase in ("brake", "over"):
            return self
        return replace(self, phase="brake", abort=reason, sent_ns=None, braked_ns=now_ns)

    def tick(self, now_ns: int) -> tuple["WatchdogPlan", MotionCommand | None]:
        """Return the plan at this time, and the command to send now, if any."""
        plan = self._advance(now_ns)
        if plan.phase in ("silence", "over"):
            return plan, None
        if plan.sent_ns is not None and now_ns - plan.sent_ns < PERIOD_NS:
            return plan, None
        last_run_ns = now_ns if plan.phase == "run" else plan.last_run_ns
        command = RUN if plan.phase == "run" else BRAKE
        return replace(plan, sent_ns=now_ns, last_run_ns=last_run_ns), command

    def _advance(self, now_ns: int) -> "WatchdogPlan":
        danger = self._danger(now_ns)
        if self.phase in ("run", "silence") and danger:
            return self.end(danger, now_ns)
        if self.phase == "run" and now_ns - self.begun_ns >= RUN_NS:
            return replace(self, phase="silence", stood_ns=None)
        if self.phase == "silence" and self._silence_over(now_ns):
            return replace(self, phase="brake", sent_ns=None, braked_ns=now_ns)
        if self.phase == "brake" and self._rests():
            return replace(self, phase="over")
        return self

    def _danger(self, now_ns: int) -> str:
        newest = self.samples[-1] if self.samples else Latest(STILL, self.begun_ns)
        if now_ns - newest.received_ns > SILENT_NS:
            return f"The board was silent for {SILENT_NS / NS_PER_S:g} s."
        if abs(newest.value.linear) > TOO_FAST_MPS:
            return f"It moved at {newest.value.linear:.2f} m/s, requested were {LINEAR_MPS:g}."
        return ""

    def _silence_over(self, now_ns: int) -> bool:
        since_ns = self.last_run_ns or self.begun_ns
        return now_ns - since_ns >= SILENCE_NS or self._stood_until(self.samples[-1].received_ns)

    def _rests(self) -> bool:
        """Return whether it has stood since the first BRAKE, by samples received after it."""
        until_ns = self.samples[-1].received_ns if self.samples else 0
        return until_ns >= (self.braked_ns or 0) + STANDS_NS and self._stood_until(until_ns)

    def _stood_until(self, until_ns: int) -> bool:
        return self.stood_ns is not None and until_ns - self.stood_ns >= STANDS_NS


def judge_watchdog(plan: WatchdogPlan) -> Verdict:
    """Return the verdict on the board's behaviour after the last command."""
    ran, silent = _split(plan)
    data = [
        ("commanded", f"{LINEAR_MPS:g} m/s for {RUN_NS / NS_PER_S:g} s, then nothing"),
        (
            "velocity at the end of RUN",
            f"{ran[-1].value.linear:.3f} m/s" if ran else "not received",
        ),
        (
            "velocity at the end of the silence",
            f"{silent[-1].value.linear:.3f} m/s" if silent else "-",
        ),
        ("velocities in the silence", str(len(silent))),
    ]
    if problem := _inconclusive(plan, ran, silent):
        return Verdict("failed", problem, tuple(data))
    return Verdict("passed", _finding(plan, ran, silent), tuple(data))


def _split(plan: WatchdogPlan) -> tuple[Sequence[Sample], Sequence[Sample]]:
    """Return the velocities during RUN, and those during the silence after it."""
    end_ns = plan.last_run_ns or plan.begun_ns
    braked_ns = plan.braked_ns or end_ns
    ran = [s for s in plan.samples if s.received_ns <= end_ns]
    return ran, [s for s in plan.samples if end_ns < s.received_ns < braked_ns]


def _inconclusive(plan: WatchdogPlan, ran: Sequence[Sample], silent: Sequence[Sample]) -> str:
    if plan.abort:
        return f"Ended early: {plan.abort}"
    if not ran or abs(ran[-1].value.linear) < MOVING_MPS:
        return "The wheels did not turn at the end of RUN: the result is inconclusive."
    if not silent:
        return "No velocity was received in the silence: the result is inconclusive."
    if not silent[-1].value.is_standing and not _steady(ran[-1], silent[-1]):
        return "It slowed down but did not stand within the silence: the result is inconclusive."
    return ""


def _finding(plan: WatchdogPlan, ran: Sequence[Sample], silent: Sequence[Sample]) -> str:
    if not silent[-1].value.is_standing:
        return f"Drives on for {SILENCE_NS / NS_PER_S:g} s without a command: no watchdog."
    last_run_ns = plan.last_run_ns or plan.begun_ns
    moving = [s.received_ns for s in silent if not s.value.is_standing]
    slowing = [s.received_ns for s in silent if not _steady(ran[-1], s)]
    stood_ns = next(s.received_ns for s in silent if not moving or s.received_ns > moving[-1])
    return (
        f"Stops by itself after {(stood_ns - last_run_ns) / NS_PER_S:.2f} s, "
        f"slowing down from {(slowing[0] - last_run_ns) / NS_PER_S:.2f} s on."
    )


def _steady(before: Sample, after: Sample) -> bool:
    """Return whether the speed is about that of RUN."""
    return abs(after.value.linear) >= 0.7 * abs(before.value.linear)
