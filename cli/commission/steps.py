"""The steps on the bus, in their order: what the operator is told, what is listened to."""

from collections.abc import Callable
from dataclasses import dataclass

from cli.commission.bus_session import Bench
from cli.commission.latches import Reset, Trip, judge_estop
from cli.commission.link import (
    CRC_FRAMES,
    TELLING_FRAMES,
    Ports,
    asked_rates,
    judge_crc,
    judge_link,
)
from cli.commission.manual_steps import bumper, sonars
from cli.commission.motion import Run, judge_motion
from cli.commission.operator import Operator
from cli.commission.resets import reset, unlatch
from cli.commission.verdict import Verdict, judged
from common.motion import Command, Twist

LINK_S = 5.0
CRC_S = 30.0
LATCH_S = 2.0
ESTOP_S = 0.25  # between two emergency stops, until one has latched; a bus may lose one
DRIVE_S = 2.0
FORWARD, TURN = Twist(linear=0.1), Twist(angular=0.2)
BLOCKS = "wheels off the ground"

Listener = Callable[[Bench, Operator], Verdict]


@dataclass(frozen=True, slots=True)
class Step:
    """One step; ``what`` tells the operator in plain words what to do."""

    name: str
    title: str
    what: str
    run: Listener


def link(bench: Bench, operator: Operator) -> Verdict:
    """Listen to the link for some seconds."""
    settings = {path: value for path, (value, _) in bench.settings("bridge").items()}
    bench.tape.mark()
    bench.listen(LINK_S)
    tape = bench.tape
    if not tape.links:
        return judged(["The bridge is not heard any more."], "")
    standby = [
        one.value.counters.get("other_port", 0)
        for one in tape.health
        if one.value.service == "bridge"
    ]
    ports = Ports(
        tuple(settings["board.listen_ports"]),
        standby[-1] - standby[0] if len(standby) > 1 else None,
    )
    switches = tape.switches[-1].value if tape.switches else None
    return judge_link([one.value for one in tape.links], switches, asked_rates(settings), ports)


def crc(bench: Bench, operator: Operator) -> Verdict:
    """Listen until enough frames have come, or for long enough."""
    tape = bench.tape
    tape.mark()
    bench.until(lambda: tape.frames >= CRC_FRAMES and tape.telling >= TELLING_FRAMES, CRC_S)
    if not tape.links:
        return judged(["The bridge is not heard any more."], "")
    return judge_crc([one.value for one in tape.links], tape.frames, tape.telling)


def estop(bench: Bench, operator: Operator) -> Verdict:
    """Put an emergency stop on the bus, and reset it."""
    if refusal := unlatch(bench, operator):
        return judged([refusal], "")
    tape = bench.tape
    at_ns = tape.mark()
    for _ in range(round(LATCH_S / ESTOP_S)):
        bench.bus.estop()
        if bench.until(lambda: "estop" in bench.latched(), ESTOP_S):
            break
    bench.until(lambda: any(m.value.command is Command.BRAKE for m in tape.motions), ESTOP_S)
    states, motions = list(tape.safety), list(tape.motions)
    done: Reset = reset(bench)
    return judge_estop(Trip("estop", at_ns, True, states, motions, done))


WAYS = ("command", "feedback")  # of the angular units


def moving(asked: Twist) -> Listener:
    """Return a step that asks for a motion, once the operator has typed that it may."""

    def run(bench: Bench, operator: Operator) -> Verdict:
        if refusal := unlatch(bench, operator):
            return judged([refusal], "")
        if not operator.confirm("The wheels will turn. All of them must hang free.", BLOCKS):
            return judged(["Not confirmed: nothing was moved."], "")
        settings = bench.settings("bridge")
        unit, feedback = (str(settings[f"wire.{way}_angular_unit"][0]) for way in WAYS)
        tape = bench.tape
        tape.mark()
        operator.say("Turning. ctrl-c stops.")
        released_ns = bench.drive(asked, DRIVE_S)
        if released_ns is None:
            return judged([_not_let_in(bench)], "")
        return judge_motion(
            Run(
                asked,
                unit,
                feedback,
                released_ns,
                tape.motions,
                tape.velocities,
                tape.mileages,
                tape.safety,
            )
        )

    return run


def _not_let_in(bench: Bench) -> str:
    tape = bench.tape
    said = tape.safety[-1].value.text if tape.safety else "nothing"
    waiting = tape.links[-1].value.waiting if tape.links else ""
    also = f" The bridge waits: {waiting}." if waiting else ""
    return f"Safety does not let the checkout drive. It says: {said}{also}"


STEPS = (
    Step("link", "Link", f"Nothing to do: the board is listened to for {LINK_S:g} s.", link),
    Step("crc", "CRC", f"Nothing to do: {CRC_FRAMES} frames are counted.", crc),
    Step(
        "sonar",
        "Sonars",
        "Stand aside at first, with 0.8 m free all around. Then hold a hand 0.2 to 0.4 m before "
        "the sonar that is named, until the next one is.",
        sonars,
    ),
    Step("bumper", "Bumper", "Press the bumper strip when told to, and let go of it.", bumper),
    Step("estop", "Emergency stop", "Nothing to do: it is asked for on the bus, and reset.", estop),
    Step(
        "forward",
        "Forward",
        f"Wheels off the ground, a hand on the vehicle's own switch. The wheels turn forward at "
        f"{FORWARD.linear:g} m/s for {DRIVE_S:g} s.",
        moving(FORWARD),
    ),
    Step(
        "turn",
        "Turn",
        f"Wheels off the ground, a hand on the vehicle's own switch. The wheels turn as for a "
        f"left turn on the spot, at {TURN.angular:g} rad/s for {DRIVE_S:g} s.",
        moving(TURN),
    ),
)
