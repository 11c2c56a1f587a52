"""Steps with the operator's hand: in front of each sonar, and on the bumper."""

import time

from cli.commission.bus_session import CheckoutSession
from cli.commission.latches import LatchTest, judge_bumper
from cli.commission.operator import Operator
from cli.commission.report import Verdict, judged
from cli.commission.sonar import (
    Finding,
    HandDetector,
    Rest,
    judge_sonars,
    nearest,
    obstructions,
    resting_ranges,
)
from common.messages import SONAR_NAMES

REST_S = 1.0
HAND_S = 60.0  # to walk around the vehicle and hold a hand there
AWAY_S = 20.0
LATCH_S = 2.0
CLEAR_S = 0.3  # the bridge needs three clear samples, and safety three samples of these
NOT_PRESSED = LatchTest("contact", None, False, (), (), None)


def sonars(session: CheckoutSession, operator: Operator) -> Verdict:
    """Check the eight sonars, one hand position each."""
    log = session.log
    log.mark()
    session.listen(REST_S)
    if not log.ultrasonics:
        return judged(["No ranges are received: see the link."], "")
    rest = resting_ranges([one.value for one in log.ultrasonics])
    if problem := obstructions(rest):
        return judged([problem], "")
    return judge_sonars(rest, [_one(session, operator, rest, name) for name in SONAR_NAMES])


def bumper(session: CheckoutSession, operator: Operator) -> Verdict:
    """Check a press and a release of the strip, and the reset."""
    if problem := session.unlatch(operator):
        return judged([problem], "")
    log = session.log
    log.mark()
    session.until(lambda: log.bumpers, LATCH_S)
    if not log.bumpers:
        return judged(["No bumper messages are received: see the link."], "")
    if log.bumpers[-1].value.pressed:
        return judge_bumper(NOT_PRESSED, True)
    operator.show(f"NOW press the bumper, within {HAND_S:g} s.")
    session.until(lambda: log.bumpers[-1].value.pressed, HAND_S)
    hits = [one.received_ns for one in log.bumpers if one.value.pressed]
    if not hits:
        return judge_bumper(NOT_PRESSED, False)
    session.until(lambda: "contact" in session.latched(), LATCH_S)
    operator.show("Pressed. NOW release it.")
    gone = session.until(lambda: not log.bumpers[-1].value.pressed, HAND_S)
    session.listen(CLEAR_S)
    states, motions = list(log.safety), list(log.motions)
    test = LatchTest("contact", hits[0], gone, states, motions, session.reset())
    return judge_bumper(test, False)


def _one(session: CheckoutSession, operator: Operator, rest: Rest, name: str) -> Finding:
    words = name.replace("_", " ")
    if rest[SONAR_NAMES.index(name)] is None:
        operator.show(f"The {words} sonar is faulty.")
        return Finding(name, ())
    operator.show(f"NOW the {words} sonar: hold a hand in front of it, within {HAND_S:g} s.")
    seen, closest = _wait(session, rest, True, HAND_S)
    if seen:
        names = ", ".join(one.replace("_", " ") for one in seen)
        operator.show(f"  detected by: {names}. Take the hand away.")
        _wait(session, rest, False, AWAY_S)
    else:
        operator.show("  no sonar has detected it.")
    return Finding(name, seen, closest)


def _wait(
    session: CheckoutSession, rest: Rest, hand: bool, timeout_s: float
) -> tuple[tuple[str, ...], float | None]:
    """Wait for a hand, or for none; return the detecting sonars, and the nearest reading."""
    log = session.log
    detector = HandDetector(rest, since_ns=log.mark())
    readings: list[float] = []

    def is_so() -> bool:
        nonlocal detector
        for one in log.ultrasonics:
            detector = detector.take(one.value, one.received_ns)
            distance = nearest(one.value)
            readings.extend([] if distance is None else [distance])
        log.ultrasonics.clear()
        return bool(detector.seen) == hand and detector.settled(time.monotonic_ns())

    found = session.until(is_so, timeout_s)
    seen = tuple(sorted(detector.seen, key=SONAR_NAMES.index)) if found else ()
    return seen, min(readings, default=None)
