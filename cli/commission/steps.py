"""Steps of the checkout on the bus, in their order, with the instructions to the operator."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from cli.commission.bus_session import CheckoutSession
from cli.commission.latches import LatchTest, judge_estop
from cli.commission.link import (
    CRC_FRAMES,
    NONZERO_FRAMES,
    Ports,
    expected_rates,
    judge_crc,
    judge_link,
)
from cli.commission.manual_steps import bumper, sonars
from cli.commission.motion import Run, judge_motion
from cli.commission.operator import Operator
from cli.commission.report import Verdict, judged
from common.motion import Command, Twist

LINK_S = 5.0
CRC_S = 30.0
LATCH_S = 2.0
ESTOP_S = 0.25  # between two emergency stops until the latch; the bus may lose one
DRIVE_S = 2.0
FORWARD, TURN = Twist(linear=0.1), Twist(angular=0.2)
PHRASE = "wheels off the ground"
NO_LINK = "No link message from the bridge."


@dataclass(frozen=True, slots=True)
class Step:
    """One step; ``what`` is the instruction to the operator."""

    name: str
    title: str
    what: str
    run: Callable[[CheckoutSession, Operator], Verdict]


def link(session: CheckoutSession, operator: Operator) -> Verdict:
    """Check the link for some seconds."""
    settings = {path: value for path, (value, _) in session.settings("bridge").items()}
    session.log.mark()
    session.listen(LINK_S)
    log = session.log
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


def crc(session: CheckoutSession, operator: Operator) -> Verdict:
    """Count frames until there are enough, or until the time limit."""
    log = session.log
    log.mark()
    session.until(lambda: log.frames >= CRC_FRAMES and log.nonzero >= NONZERO_FRAMES, CRC_S)
    if not log.links:
        return judged([NO_LINK], "")
    return judge_crc([one.value for one in log.links], log.frames, log.nonzero)


def estop(session: CheckoutSession, operator: Operator) -> Verdict:
    """Publish an emergency stop, and reset it."""
    if problem := session.unlatch(operator):
        return judged([problem], "")
    log = session.log
    at_ns = log.mark()
    for _ in range(round(LATCH_S / ESTOP_S)):
        session.bus.estop()
        if session.until(lambda: "estop" in session.latched(), ESTOP_S):
            break
    session.until(lambda: any(m.value.command is Command.BRAKE for m in log.motions), ESTOP_S)
    states, motions = list(log.safety), list(log.motions)
    return judge_estop(LatchTest("estop", at_ns, True, states, motions, session.reset()))


def move(requested: Twist, session: CheckoutSession, operator: Operator) -> Verdict:
    """Drive a motion after the operator's confirmation."""
    if problem := session.unlatch(operator):
        return judged([problem], "")
    if not operator.confirm("The wheels will turn. All of them must be off the ground.", PHRASE):
        return judged(["Not confirmed: no motion was requested."], "")
    settings = session.settings("bridge")
    command, feedback = (
        str(settings[f"wire.{direction}_angular_unit"][0]) for direction in ("command", "feedback")
    )
    log = session.log
    log.mark()
    operator.show("The wheels turn. Ctrl-C stops them.")
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
