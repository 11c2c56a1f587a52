"""Verdicts on bumper and emergency stop: whether each latches, brakes, and can be reset. Pure."""

from collections.abc import Iterator, Sequence
from itertools import dropwhile
from typing import NamedTuple

from cli.commission.report import Verdict, judged, seconds
from cli.commission.texts import ENGLISH, Say
from common.freshness import NS_PER_S, Latest
from t2.messages import Command, Motion, SafetyState

LIMIT_S = 0.5  # from the cause to the latch and to BRAKE, including a slow bus


class Reset(NamedTuple):
    """A requested reset with its answer, and what is latched after it."""

    requested_ns: int
    granted: bool
    text: str
    latched: tuple[str, ...]

    def problem(self, say: Say = ENGLISH) -> str:
        """Return why the robot is not reset; empty if it is."""
        if not self.granted:
            return say("latch.reset", text=self.text)
        return say("latch.after", causes=say.causes(self.latched)) if self.latched else ""


class LatchTest(NamedTuple):
    """Messages of one latch test, with local receive times."""

    cause: str  # as safety names it
    at_ns: int  # start of the cause
    states: Sequence[Latest[SafetyState]]
    motions: Sequence[Latest[Motion]]
    reset: Reset


def judge_latch(test: LatchTest, problem: str = "", say: Say = ENGLISH) -> Verdict:
    """Return the verdict on one latch; ``problem`` is one that was found before."""
    latches = [s.received_ns for s in test.states if test.cause in s.value.latched]
    # The bridge may have braked earlier.
    brakes = [m.received_ns for m in test.motions if m.value.command is Command.BRAKE]
    problems, data = [problem], []
    latch = say("latch.latch", cause=say.causes([test.cause]))
    for action, times_ns in ((latch, latches), (say("latch.brake"), brakes)):
        # A state may overtake the sample that caused it on the bus: that counts as zero.
        took_s = max(0, times_ns[0] - test.at_ns) / NS_PER_S if times_ns else None
        data.append((say("figure.after", action=action), seconds(took_s, 3, say)))
        if took_s is None:
            problems.append(say("latch.not", action=action))
        elif took_s > LIMIT_S:
            problems.append(say("latch.late", took=took_s, action=action, limit=LIMIT_S))
    data += [("BRAKE commands received", str(len(brakes))), ("reset", test.reset.text)]
    return judged([*problems, *_until_reset(test, say)], say("latch.good"), data, say)


def _until_reset(test: LatchTest, say: Say) -> Iterator[str]:
    """Yield the problems from the first BRAKE to the reset."""
    before_reset = (
        m.value.command for m in test.motions if m.received_ns <= test.reset.requested_ns
    )
    braked = dropwhile(lambda command: command is not Command.BRAKE, before_reset)
    if others := sorted({command.upper() for command in braked if command is not Command.BRAKE}):
        yield say("latch.others", commands=tuple(others))
    yield test.reset.problem(say)
