"""The trial of the board's own command watchdog: what to send when, and what was learnt.

::

    RUN at 20 Hz, 1 s ──> nothing ──> BREAK at 20 Hz until standing
                          at most 1 s, or until standing

A board that is not heard, or a speed beyond what was asked, ends the first two at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from cli.commission.verdict import Verdict
from common.freshness import NS_PER_S
from common.motion import is_standing
from common.wire.commands import MotionCommand, MotionKind

LINEAR_MPS = 0.05
RUN_NS = NS_PER_S
SILENCE_NS = NS_PER_S
PERIOD_NS = NS_PER_S // 20
DEAF_NS = NS_PER_S // 5  # without a velocity: what cannot be seen is not let go on
TOO_FAST_MPS = 0.2
MOVING_MPS = 0.03  # over the standstill's 0.02: it did obey the RUN
STANDS_NS = NS_PER_S // 5  # for so long, to count as standing

RUN = MotionCommand(MotionKind.RUN, round(LINEAR_MPS * 1000))
BREAK = MotionCommand(MotionKind.BREAK)

Phase = Literal["run", "silence", "brake", "over"]


@dataclass(frozen=True, slots=True)
class Sample:
    """A velocity of the board, with the local receive time; m/s and rad/s."""

    linear: float
    angular: float
    received_ns: int

    @property
    def stands(self) -> bool:
        """Whether it counts as standstill."""
        return is_standing(self.linear, self.angular)


@dataclass(frozen=True, slots=True)
class Trial:
    """Where the trial stands; a new one begins with RUN."""

    begun_ns: int
    phase: Phase = "run"
    sent_ns: int | None = None  # the newest command
    last_run_ns: int | None = None
    broken_ns: int | None = None  # when BREAK began
    cut: str = ""  # why it was ended early
    samples: tuple[Sample, ...] = ()
    stood_ns: int | None = None  # since when it stands

    def hear(self, sample: Sample) -> "Trial":
        """Return the trial after one velocity of the board."""
        stood_ns = (self.stood_ns or sample.received_ns) if sample.stands else None
        return replace(self, samples=(*self.samples, sample), stood_ns=stood_ns)

    def end(self, reason: str, now_ns: int) -> "Trial":
        """Return the trial with BREAK from now on, for a reason, unless it is there already."""
        if self.phase in ("brake", "over"):
            return self
        return replace(self, phase="brake", cut=reason, sent_ns=None, broken_ns=now_ns)

    def tick(self, now_ns: int) -> tuple["Trial", MotionCommand | None]:
        """Return the trial at this moment, and the command to send now, if any."""
        trial = self._advance(now_ns)
        if trial.phase in ("silence", "over"):
            return trial, None
        if trial.sent_ns is not None and now_ns - trial.sent_ns < PERIOD_NS:
            return trial, None
        last_run_ns = now_ns if trial.phase == "run" else trial.last_run_ns
        command = RUN if trial.phase == "run" else BREAK
        return replace(trial, sent_ns=now_ns, last_run_ns=last_run_ns), command

    def _advance(self, now_ns: int) -> "Trial":
        danger = self._danger(now_ns)
        if self.phase in ("run", "silence") and danger:
            return self.end(danger, now_ns)
        if self.phase == "run" and now_ns - self.begun_ns >= RUN_NS:
            return replace(self, phase="silence", stood_ns=None)
        if self.phase == "silence" and self._silence_over(now_ns):
            return replace(self, phase="brake", sent_ns=None, broken_ns=now_ns)
        if self.phase == "brake" and self._rests():
            return replace(self, phase="over")
        return self

    def _danger(self, now_ns: int) -> str:
        heard_ns = self.samples[-1].received_ns if self.samples else self.begun_ns
        if now_ns - heard_ns > DEAF_NS:
            return f"The board was not heard for {DEAF_NS / NS_PER_S:g} s."
        if self.samples and abs(self.samples[-1].linear) > TOO_FAST_MPS:
            return f"It moved at {self.samples[-1].linear:.2f} m/s, asked were {LINEAR_MPS:g}."
        return ""

    def _silence_over(self, now_ns: int) -> bool:
        since_ns = self.last_run_ns or self.begun_ns
        return now_ns - since_ns >= SILENCE_NS or self._stood_until(self.samples[-1].received_ns)

    def _rests(self) -> bool:
        """Tell whether it has stood since the first BREAK, by samples that came after it."""
        until_ns = self.samples[-1].received_ns if self.samples else 0
        return until_ns >= (self.broken_ns or 0) + STANDS_NS and self._stood_until(until_ns)

    def _stood_until(self, until_ns: int) -> bool:
        return self.stood_ns is not None and until_ns - self.stood_ns >= STANDS_NS


def judge_trial(trial: Trial) -> Verdict:
    """Say what the board did when the commands ended."""
    ran, silent = _split(trial)
    data = [
        ("commanded", f"{LINEAR_MPS:g} m/s for {RUN_NS / NS_PER_S:g} s, then nothing"),
        ("velocity at the end of RUN", f"{ran[-1].linear:.3f} m/s" if ran else "not heard"),
        ("velocity at the end of the silence", f"{silent[-1].linear:.3f} m/s" if silent else "-"),
        ("velocities in the silence", str(len(silent))),
    ]
    if problem := _inconclusive(trial, ran, silent):
        return Verdict("failed", problem, tuple(data))
    return Verdict("passed", _finding(trial, ran, silent), tuple(data))


def _split(trial: Trial) -> tuple[Sequence[Sample], Sequence[Sample]]:
    """Return the velocities while RUN was sent, and those in the silence after it."""
    end_ns = trial.last_run_ns or trial.begun_ns
    broken_ns = trial.broken_ns or end_ns
    ran = [s for s in trial.samples if s.received_ns <= end_ns]
    return ran, [s for s in trial.samples if end_ns < s.received_ns < broken_ns]


def _inconclusive(trial: Trial, ran: Sequence[Sample], silent: Sequence[Sample]) -> str:
    if trial.cut:
        return f"Ended early: {trial.cut}"
    if not ran or abs(ran[-1].linear) < MOVING_MPS:
        return "The wheels did not turn at the end of RUN: nothing can be learnt."
    if not silent:
        return "No velocity was heard in the silence: nothing can be learnt."
    if not silent[-1].stands and not _steady(ran[-1], silent[-1]):
        return "It slowed down but did not stand within the silence: nothing can be said."
    return ""


def _finding(trial: Trial, ran: Sequence[Sample], silent: Sequence[Sample]) -> str:
    if not silent[-1].stands:
        return f"Drives on for {SILENCE_NS / NS_PER_S:g} s without a command: no watchdog."
    last_run_ns = trial.last_run_ns or trial.begun_ns
    moving = [s.received_ns for s in silent if not s.stands]
    slowing = [s.received_ns for s in silent if not _steady(ran[-1], s)]
    stood_ns = next(s.received_ns for s in silent if not moving or s.received_ns > moving[-1])
    return (
        f"Stops by itself after {(stood_ns - last_run_ns) / NS_PER_S:.2f} s, "
        f"slowing down from {(slowing[0] - last_run_ns) / NS_PER_S:.2f} s on."
    )


def _steady(before: Sample, after: Sample) -> bool:
    """Tell whether it still moves about as it did under RUN."""
    return abs(after.linear) >= 0.7 * abs(before.linear)
