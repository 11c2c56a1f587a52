"""Steps of the checkout on the bus, in their order, with the instructions to the operator."""

from functools import partial

from cli.commission.bus_session import CheckoutSession
from cli.commission.latches import LatchTest, judge_bumper, judge_estop
from cli.commission.link import (
    CRC_FRAMES,
    NONZERO_FRAMES,
    Ports,
    expected_rates,
    judge_crc,
    judge_link,
)
from cli.commission.motion import Run, judge_motion
from cli.commission.operator import Step, confirm, show
from cli.commission.report import Verdict, judged
from cli.commission.sonar import (
    Finding,
    HandDetector,
    Rest,
    judge_sonars,
    nearest,
    obstructions,
    resting_ranges,
    words,
)
from common import clock
from common.messages import SONAR_NAMES
from common.motion import Command, Twist

LINK_S = 5.0
CRC_S = 30.0
REST_S = 1.0
HAND_S = 60.0  # to walk around the vehicle and hold a hand there
AWAY_S = 20.0
LATCH_S = 2.0
CLEAR_S = 0.3  # the bridge needs three clear samples, and safety three samples of these
ESTOP_S = 0.25  # between two emergency stops until the latch; the bus may lose one
DRIVE_S = 2.0
FORWARD, TURN = Twist(linear=0.1), Twist(angular=0.2)
PHRASE = "wheels off the ground"
NO_LINK = "No link message from the bridge."
NOT_PRESSED = LatchTest("contact", None, False, (), (), None)


def link(session: CheckoutSession) -> Verdict:
    """Check the link for some seconds."""
    settings = {path: setting.value for path, setting in session.settings("bridge").items()}
    log = session.log
    log.mark()
    session.listen(LINK_S)
    if not log.links:
        return judged([NO_LINK], "")
    bridge = (one.value for one in log.health if one.value.service == "bridge")
    standby = [health.counters.get("other_port", 0) for health in bridge]
    ports = Ports(
        tuple(settings["board.listen_ports"]),
        standby[-1] - standby[0] if len(standby) > 1 else None,
    )
    switches = log.switches[-1].value if log.switches else None
    return judge_link([one.value for one in log.links], switches, expected_rates(settings), ports)


def crc(session: CheckoutSession) -> Verdict:
    """Count frames until there are enough, or until the time limit."""
    log = session.log
    log.mark()
    session.until(lambda: log.frames >= CRC_FRAMES and log.nonzero >= NONZERO_FRAMES, CRC_S)
    if not log.links:
        return judged([NO_LINK], "")
    return judge_crc([one.value for one in log.links], log.frames, log.nonzero)


def sonars(session: CheckoutSession) -> Verdict:
    """Check the eight sonars, one hand position each."""
    session.log.mark()
    session.listen(REST_S)
    if not session.log.ultrasonics:
        return judged(["No ranges are received: see the link."], "")
    rest = resting_ranges([one.value for one in session.log.ultrasonics])
    if problem := obstructions(rest):
        return judged([problem], "")
    return judge_sonars(rest, [_find(session, rest, name) for name in SONAR_NAMES])


def _find(session: CheckoutSession, rest: Rest, name: str) -> Finding:
    if rest[SONAR_NAMES.index(name)] is None:
        show(f"The {words(name)} sonar is faulty.")
        return Finding(name, ())
    show(f"NOW the {words(name)} sonar: hold a hand in front of it, within {HAND_S:g} s.")
    seen, closest = _wait(session, rest, True, HAND_S)
    if seen:
        show(f"  detected by: {', '.join(map(words, seen))}. Take the hand away.")
        _wait(session, rest, False, AWAY_S)
    else:
        show("  no sonar has detected it.")
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
        return bool(detector.seen) == hand and detector.settled(clock.now_ns())

    found = session.until(is_so, timeout_s)
    seen = tuple(sorted(detector.seen, key=SONAR_NAMES.index)) if found else ()
    return seen, min(readings, default=None)


def bumper(session: CheckoutSession) -> Verdict:
    """Check a press and a release of the strip, and the reset."""
    if problem := session.unlatch():
        return judged([problem], "")
    log = session.log
    log.mark()
    session.until(lambda: log.bumpers, LATCH_S)
    if not log.bumpers:
        return judged(["No bumper messages are received: see the link."], "")
    if log.bumpers[-1].value.pressed:
        return judge_bumper(NOT_PRESSED, True)
    show(f"NOW press the bumper, within {HAND_S:g} s.")
    session.until(lambda: log.bumpers[-1].value.pressed, HAND_S)
    hits = [one.received_ns for one in log.bumpers if one.value.pressed]
    if not hits:
        return judge_bumper(NOT_PRESSED, False)
    session.until(lambda: "contact" in session.latched(), LATCH_S)
    show("Pressed. NOW release it.")
    gone = session.until(lambda: not log.bumpers[-1].value.pressed, HAND_S)
    session.listen(CLEAR_S)
    return judge_bumper(_latch_test(session, "contact", hits[0], gone), False)


def estop(session: CheckoutSession) -> Verdict:
    """Publish an emergency stop, and reset it."""
    if problem := session.unlatch():
        return judged([problem], "")
    log = session.log
    at_ns = log.mark()
    for _ in range(round(LATCH_S / ESTOP_S)):
        session.bus.estop()
        if session.until(lambda: "estop" in session.latched(), ESTOP_S):
            break
    session.until(lambda: any(m.value.command is Command.BRAKE for m in log.motions), ESTOP_S)
    return judge_estop(_latch_test(session, "estop", at_ns, True))


def _latch_test(session: CheckoutSession, cause: str, at_ns: int, gone: bool) -> LatchTest:
    """Reset the latch; the messages are copied before, because the reset discards them."""
    states, motions = list(session.log.safety), list(session.log.motions)
    return LatchTest(cause, at_ns, gone, states, motions, session.reset())


def move(requested: Twist, session: CheckoutSession) -> Verdict:
    """Drive a motion after the operator's confirmation."""
    if problem := session.unlatch():
        return judged([problem], "")
    if not confirm("The wheels will turn. All of them must be off the ground.", PHRASE):
        return judged(["Not confirmed: no motion was requested."], "")
    settings = session.settings("bridge")
    command = str(settings["wire.command_angular_unit"].value)
    feedback = str(settings["wire.feedback_angular_unit"].value)
    log = session.log
    log.mark()
    show("The wheels turn. Ctrl-C stops them.")
    released_ns = session.drive(requested, DRIVE_S)
    if released_ns is None:
        return judged([_not_granted(session)], "")
    messages = log.motions, log.velocities, log.mileages, log.safety
    return judge_motion(Run(requested, command, feedback, released_ns, *messages))


def _not_granted(session: CheckoutSession) -> str:
    log = session.log
    text = log.safety[-1].value.text if log.safety else "no state"
    waiting = log.links[-1].value.waiting if log.links else ""
    bridge = f" The bridge waits for: {waiting}." if waiting else ""
    return f"Safety does not grant motion to the checkout. It reports: {text}{bridge}"


STEPS = (
    Step("link", "Link", f"No action needed: the link is measured for {LINK_S:g} s.", link),
    Step("crc", "CRC", f"No action needed: {CRC_FRAMES} frames are counted.", crc),
    Step(
        "sonar",
        "Sonars",
        "First stand aside, with 0.8 m free all around. Then hold a hand 0.2 to 0.4 m in front of "
        "the named sonar, until the next one is named.",
        sonars,
    ),
    Step("bumper", "Bumper", "Press and release the bumper strip when prompted.", bumper),
    Step("estop", "Emergency stop", "No action needed: it is published, and reset.", estop),
    Step(
        "forward",
        "Forward",
        f"Wheels off the ground, a hand on the vehicle's own switch. The wheels turn forward at "
        f"{FORWARD.linear:g} m/s for {DRIVE_S:g} s.",
        partial(move, FORWARD),
    ),
    Step(
        "turn",
        "Turn",
        f"Wheels off the ground, a hand on the vehicle's own switch. The wheels turn as for a "
        f"left turn on the spot, at {TURN.angular:g} rad/s for {DRIVE_S:g} s.",
        partial(move, TURN),
    ),
)
