"""The steps that want the operator's hand: before each sonar, and on the bumper."""

import time

from cli.commission.bus_session import Bench
from cli.commission.latches import Trip, judge_bumper
from cli.commission.operator import Operator
from cli.commission.resets import reset, unlatch
from cli.commission.sonar import (
    Finding,
    Rest,
    Watch,
    at_rest,
    crowded,
    judge_sonars,
    nearest,
)
from cli.commission.verdict import Verdict, judged
from common.messages import SONAR_NAMES

REST_S = 1.0
HAND_S = 60.0  # to walk around the vehicle and hold a hand there
AWAY_S = 20.0
LATCH_S = 2.0
CLEAR_S = 0.3  # the bridge wants three clear samples, and safety three good ones of these


def sonars(bench: Bench, operator: Operator) -> Verdict:
    """Go around: one hand, one sonar, eight times."""
    tape = bench.tape
    tape.mark()
    bench.listen(REST_S)
    if not tape.ultrasonics:
        return judged(["No ranges are heard: see the link."], "")
    rest = at_rest([one.value for one in tape.ultrasonics])
    if words := crowded(rest):
        return judged([words], "")
    return judge_sonars(rest, [_one(bench, operator, rest, name) for name in SONAR_NAMES])


def bumper(bench: Bench, operator: Operator) -> Verdict:
    """Have the strip pressed and let go; then reset."""
    if refusal := unlatch(bench, operator):
        return judged([refusal], "")
    tape = bench.tape
    tape.mark()
    bench.until(lambda: tape.bumpers, LATCH_S)
    if not tape.bumpers:
        return judged(["The bumper is not heard: see the link."], "")
    if tape.bumpers[-1].value.pressed:
        return judge_bumper(Trip("contact", None, False, (), (), None), True)
    operator.say(f"NOW press the bumper, within {HAND_S:g} s.")
    bench.until(lambda: tape.bumpers[-1].value.pressed, HAND_S)
    hits = [one.received_ns for one in tape.bumpers if one.value.pressed]
    if not hits:
        return judge_bumper(Trip("contact", None, False, (), (), None), False)
    bench.until(lambda: "contact" in bench.latched(), LATCH_S)
    operator.say("Pressed. NOW let go of it.")
    gone = bench.until(lambda: not tape.bumpers[-1].value.pressed, HAND_S)
    bench.listen(CLEAR_S)
    states, motions = list(tape.safety), list(tape.motions)
    return judge_bumper(Trip("contact", hits[0], gone, states, motions, reset(bench)), False)


def _one(bench: Bench, operator: Operator, rest: Rest, name: str) -> Finding:
    words = name.replace("_", " ")
    if rest[SONAR_NAMES.index(name)] is None:
        operator.say(f"The {words} sonar is faulty.")
        return Finding(name, ())
    operator.say(f"NOW the {words} sonar: hold a hand before it, within {HAND_S:g} s.")
    seen, closest = _wait(bench, rest, True, HAND_S)
    if seen:
        answered = ", ".join(one.replace("_", " ") for one in seen)
        operator.say(f"  seen by: {answered}. Take the hand away.")
        _wait(bench, rest, False, AWAY_S)
    else:
        operator.say("  no sonar has seen it.")
    return Finding(name, seen, closest)


def _wait(
    bench: Bench, rest: Rest, hand: bool, patience_s: float
) -> tuple[tuple[str, ...], float | None]:
    """Wait for a hand, or for none; return who sees it, and the nearest reading meanwhile."""
    tape = bench.tape
    watch = Watch(rest, since_ns=tape.mark())
    closest: list[float] = []

    def so() -> bool:
        nonlocal watch
        for one in tape.ultrasonics:
            watch = watch.take(one.value, one.received_ns)
            distance = nearest(one.value)
            closest.extend([] if distance is None else [distance])
        tape.ultrasonics.clear()
        return bool(watch.seen) == hand and watch.settled(time.monotonic_ns())

    found = bench.until(so, patience_s)
    seen = tuple(sorted(watch.seen, key=SONAR_NAMES.index)) if found else ()
    return seen, min(closest, default=None)
