"""Whether a hit of the bumper and an emergency stop latch, brake, and can be reset."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cli.commission.verdict import Row, Verdict, judged
from common.freshness import NS_PER_S, Latest
from common.messages import Motion, SafetyState
from common.motion import Command

PROMPT_S = 0.5  # from the cause to the latch and to BREAK, a slow bus included


@dataclass(frozen=True, slots=True)
class Reset:
    """When a reset was asked for, what was answered, and what stayed latched after it."""

    asked_ns: int
    granted: bool
    text: str
    latched: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Trip:
    """What was heard of one trip; times are of reception here."""

    cause: str  # as safety names it
    at_ns: int | None  # when it began; None when it never did
    gone: bool  # whether the cause itself went away again
    states: Sequence[Latest[SafetyState]]
    motions: Sequence[Latest[Motion]]
    reset: Reset | None


def judge_bumper(trip: Trip, pressed_before: bool) -> Verdict:
    """Judge a press and a release of the bumper."""
    if pressed_before:
        return judged(
            ["The bumper reads pressed before anybody pressed it: stuck, or the wrong way round."],
            "",
        )
    if trip.at_ns is None:
        return judged(["No press was seen: is the strip connected?"], "")
    problems = [] if trip.gone else ["The bumper stays pressed though it was let go."]
    return judged([*problems, *_problems(trip)], "Pressed, latched, released, reset.", _data(trip))


def judge_estop(trip: Trip) -> Verdict:
    """Judge an emergency stop that this tool has put on the bus."""
    return judged(_problems(trip), "Stopped, latched, reset.", _data(trip))


def _problems(trip: Trip) -> Iterator[str]:
    latched_s, braked_s = latched_after_s(trip), braked_after_s(trip)
    for took_s, what in ((latched_s, f"latch {trip.cause}"), (braked_s, "command BREAK")):
        if took_s is None:
            yield f"Safety did not {what}."
        elif took_s > PROMPT_S:
            yield f"It took safety {took_s:.2f} s to {what}, allowed are {PROMPT_S:g} s."
    if braked_s is not None and (kinds := _let_through(trip)):
        yield f"Before the reset, safety sent {', '.join(kinds)} in place of BREAK."
    if trip.reset is None:
        yield "No reset was tried."
    elif not trip.reset.granted:
        yield f"The reset was refused: {trip.reset.text}"
    elif trip.reset.latched:
        yield f"After the reset this is still latched: {', '.join(trip.reset.latched)}."


def latched_after_s(trip: Trip) -> float | None:
    """Return how long it took until safety said that it is latched."""
    return _first(trip, [s.received_ns for s in trip.states if trip.cause in s.value.latched])


def braked_after_s(trip: Trip) -> float | None:
    """Return how long it took until safety commanded BREAK; the bridge may have been quicker."""
    return _first(trip, [m.received_ns for m in trip.motions if m.value.command is Command.BRAKE])


def _first(trip: Trip, times_ns: Sequence[int]) -> float | None:
    # A state may overtake the sample that caused it on its way here: that took no time.
    return max(0, times_ns[0] - (trip.at_ns or 0)) / NS_PER_S if times_ns else None


def _let_through(trip: Trip) -> list[str]:
    """Return what else was commanded between the first BREAK and the reset."""
    begun_ns = next(m.received_ns for m in trip.motions if m.value.command is Command.BRAKE)
    end_ns = trip.reset.asked_ns if trip.reset else trip.motions[-1].received_ns
    return sorted(
        {
            m.value.command.upper()
            for m in trip.motions
            if begun_ns < m.received_ns <= end_ns and m.value.command is not Command.BRAKE
        }
    )


def _data(trip: Trip) -> list[Row]:
    braked = sum(m.value.command is Command.BRAKE for m in trip.motions)
    reset = trip.reset
    return [
        ("latched after", _seconds(latched_after_s(trip))),
        ("BREAK commanded after", _seconds(braked_after_s(trip))),
        ("BREAK commands heard", str(braked)),
        ("reset", reset.text if reset else "not tried"),
    ]


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.3f} s"
