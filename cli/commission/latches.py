"""Verdicts on bumper and emergency stop: whether each latches, brakes, and can be reset. Pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cli.commission.report import Row, Verdict, judged, seconds
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
    problems = [] if test.gone else ["The bumper stays pressed after its release."]
    return judged([*problems, *_problems(test)], "Pressed, latched, released, reset.", _data(test))


def judge_estop(test: LatchTest) -> Verdict:
    """Return the verdict on an emergency stop that the checkout has published."""
    return judged(_problems(test), "Stopped, latched, reset.", _data(test))


def _problems(test: LatchTest) -> Iterator[str]:
    latched_s, braked_s = latched_after_s(test), braked_after_s(test)
    for took_s, action in ((latched_s, f"latch {test.cause}"), (braked_s, "command BRAKE")):
        if took_s is None:
            yield f"Safety did not {action}."
        elif took_s > LIMIT_S:
            yield f"Safety took {took_s:.2f} s to {action}, the limit is {LIMIT_S:g} s."
    if braked_s is not None and (kinds := _other_commands(test)):
        yield f"Before the reset, safety sent {', '.join(kinds)} instead of BRAKE."
    if test.reset is None:
        yield "No reset was requested."
    elif not test.reset.granted:
        yield f"The reset was refused: {test.reset.text}"
    elif test.reset.latched:
        yield f"Still latched after the reset: {', '.join(test.reset.latched)}."


def latched_after_s(test: LatchTest) -> float | None:
    """Return the time until safety's state showed the latch."""
    return _first(test, [s.received_ns for s in test.states if test.cause in s.value.latched])


def braked_after_s(test: LatchTest) -> float | None:
    """Return the time until safety commanded BRAKE; the bridge may have braked earlier."""
    return _first(test, [m.received_ns for m in test.motions if m.value.command is Command.BRAKE])


def _first(test: LatchTest, times_ns: Sequence[int]) -> float | None:
    # A state may overtake the sample that caused it on the bus: that counts as zero.
    return max(0, times_ns[0] - (test.at_ns or 0)) / NS_PER_S if times_ns else None


def _other_commands(test: LatchTest) -> list[str]:
    """Return the other commands between the first BRAKE and the reset."""
    begun_ns = next(m.received_ns for m in test.motions if m.value.command is Command.BRAKE)
    end_ns = test.reset.requested_ns if test.reset else test.motions[-1].received_ns
    between = (m.value.command for m in test.motions if begun_ns < m.received_ns <= end_ns)
    return sorted({command.upper() for command in between if command is not Command.BRAKE})


def _data(test: LatchTest) -> list[Row]:
    braked = sum(m.value.command is Command.BRAKE for m in test.motions)
    return [
        ("latched after", seconds(latched_after_s(test), 3)),
        ("BRAKE commanded after", seconds(braked_after_s(test), 3)),
        ("BRAKE commands received", str(braked)),
        ("reset", test.reset.text if test.reset else "not requested"),
    ]
