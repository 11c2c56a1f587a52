"""Fault injection: requests of the control socket, applied to the simulation."""

from msgspec import Struct

from common.motion import STILL
from common.wire import reports as r
from common.wire.frame import Frame
from sim import requests as q
from sim.board import DRIVER_SIDES
from sim.geometry import Pose
from sim.simulation import Simulation
from sim.trace import Disturbed, Truth

REPORTS: dict[q.ReportName, type[Frame]] = {
    "velocity": r.VelocityReport,
    "mileage": r.DistanceReport,
    "ultrasonic": r.UltrasonicReport,
    "bumper": r.BumperReport,
    "driver": r.DriverReport,
}


class Reply(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The answer to a request; ``error`` is the reason of a refusal."""

    ok: bool
    error: str = ""
    truth: Truth | None = None


def handle(simulation: Simulation, request: q.Asked, now_ns: int) -> Reply:
    """Apply one request; a refused one changes nothing."""
    if isinstance(request, q.GetTruth):
        return Reply(ok=True, truth=simulation.truth(now_ns))
    error = ""
    if isinstance(request, q.Place):
        error = _place(simulation, request.pose, now_ns)
    elif isinstance(request, q.Wire | q.Mute | q.Firmware):
        _disturb_link(simulation, request)
    else:
        _disturb_board(simulation, request, now_ns)
    simulation.record(Disturbed(mono_ns=now_ns, request=request, error=error))
    return Reply(ok=not error, error=error)


def _place(simulation: Simulation, pose: Pose, now_ns: int) -> str:
    """Return the reason of a refusal, empty when done."""
    if simulation.world.blocks(simulation.body, pose):
        return f"an obstacle is at x {pose.x:g}, y {pose.y:g}"
    simulation.pose, simulation.twist = pose, STILL
    simulation.update_bumper(now_ns)
    return ""


def _disturb_link(simulation: Simulation, request: q.Wire | q.Mute | q.Firmware) -> None:
    if isinstance(request, q.Mute):
        simulation.output.mute([REPORTS[name] for name in request.reports], request.every)
    elif isinstance(request, q.Firmware):
        simulation.output.firmware = request
    else:
        if request.direction in ("to_pc", "both"):
            simulation.to_pc.faults = request
        if request.direction in ("to_board", "both"):
            simulation.to_board.faults = request


def _disturb_board(
    simulation: Simulation,
    request: q.Bumper | q.Sonar | q.Driver | q.Freeze | q.PowerCycle | q.Flood,
    now_ns: int,
) -> None:
    match request:
        case q.Bumper(pressed=pressed):
            simulation.pressed_by_hand = pressed
            simulation.update_bumper(now_ns)
        case q.Sonar():
            simulation.sonars.inject(request)
        case q.Driver(side=side, bits=bits):
            simulation.set_driver(DRIVER_SIDES[side], bits, now_ns)
        case q.Freeze(seconds=seconds):
            simulation.freeze(seconds, now_ns)
        case q.PowerCycle(seconds=seconds):
            simulation.power_cycle(seconds, now_ns)
        case q.Flood(rate=rate, seconds=seconds, garbage=garbage):  # pragma: no branch - the last
            simulation.flood(rate, seconds, garbage, now_ns)
