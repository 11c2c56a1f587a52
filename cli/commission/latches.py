"""Verdicts on bumper and emergency stop: whether each latches, brakes, and can be reset. Pure."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import dropwhile

from cli.commission.report import Verdict, judged, seconds
from common.freshness import NS_PER_S, Latest
from common.messages import Motion, SafetyState
from common.motion import Command

LIMIT_S = 0.5  # from the cause to the latch and to BRAKE, including a slow bus


@dataclass(frozen=True, slots=True)
class Reset:
    """A requested reset with its answer, and what stays latched after it."""

    requested_ns: int
    granted: bool
    text: str
    latched: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LatchTest:
    """Messages of one latch test, with local receive times."""

    cause: str  # as safety names it
    at_ns: int | None  # start of the cause; None if it did not occur
    gone: bool  # whether the cause ended
    states: Sequence[Latest[SafetyState]]
    motions: Sequence[Latest[Motion]]
    reset: Reset | None


def judge_bumper(test: LatchTest, pressed_before: bool) -> Verdict:
    """Return the verdict on a press and a release of the bumper."""
    if pressed_before:
        return judged(["The bumper is pressed before the test: stuck or inverted."], "")
    if test.at_ns is None:
        return judged(["No press was received: is the strip connected?"], "")
    stuck = "" if test.gone else "The bumper stays pressed after its release."
    return _judged(test, "Pressed, latched, released, reset.", stuck)


def judge_estop(test: LatchTest) -> Verdict:
    """Return the verdict on an emergency stop that the checkout has published."""
    return _judged(test, "Stopped, latched, reset.")


def _judged(test: LatchTest, passed: str, problem: str = "") -> Verdict:
    latches = [s.received_ns for s in test.states if test.cause in s.value.latched]
    # The bridge may have braked earlier.
    brakes = [m.received_ns for m in test.motions if m.value.command is Command.BRAKE]
    latched_s, braked_s = _first_after_s(test, latches), _first_after_s(test, brakes)
    data = [
        ("latched after", seconds(latched_s, 3)),
        ("BRAKE commanded after", seconds(braked_s, 3)),
        ("BRAKE commands received", str(len(brakes))),
        ("reset", test.reset.text if test.reset else "not requested"),
    ]
    return judged([problem, *_problems(test, latched_s, braked_s)], passed, data)


def _first_after_s(test: LatchTest, times_ns: Sequence[int]) -> float | None:
    # A state may overtake the sample that caused it on the bus: that counts as zero.
    return max(0, times_ns[0] - (test.at_ns or 0)) / NS_PER_S if times_ns else None


def _problems(test: LatchTest, latched_s: float | None, braked_s: float | None) -> Iterator[str]:
    for took_s, action in ((latched_s, f"latch {test.cause}"), (braked_s, "command BRAKE")):
        if took_s is None:
            yield f"Safety did not {action}."
        elif took_s > LIMIT_S:
            yield f"Safety took {took_s:.2f} s to {action}, the limit is {LIMIT_S:g} s."
    if kinds := _other_commands(test):
        yield f"Before the reset, safety sent {', '.join(kinds)} instead of BRAKE."
    if test.reset is None:
        yield "No reset was requested."
    elif not test.reset.granted:
        yield f"The reset was refused: {test.reset.text}"
    elif test.reset.latched:
        yield f"Still latched after the reset: {', '.join(test.reset.latched)}."


def _other_commands(test: LatchTest) -> list[str]:
    """Return the other commands after the first BRAKE, until the reset."""
    end_ns = test.reset.requested_ns if test.reset else math.inf
    before_reset = (m.value.command for m in test.motions if m.received_ns <= end_ns)
    braked = dropwhile(lambda command: command is not Command.BRAKE, before_reset)
    return sorted({command.upper() for command in braked if command is not Command.BRAKE})
