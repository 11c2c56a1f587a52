"""Fault injection: requests from the control socket or a script, applied to the simulation."""

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.motion import STILL
from common.wire import reports as r
from common.wire.frame import Frame
from sim import requests as q
from sim.board import DRIVER_SIDES
from sim.geometry import Pose
from sim.simulation import Simulation
from sim.trace import Disturbed, Truth
from sim.world import World

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


class Injection:
    """Applies requests; those of a script at their time."""

    def __init__(self, simulation: Simulation, script: q.Script, now_ns: int) -> None:
        self._simulation = simulation
        self._start_ns = now_ns
        self._steps = sorted(script.steps, key=lambda step: step.at, reverse=True)

    def advance(self, now_ns: int) -> None:
        """Apply the due steps of the script, each at its own time; advance the simulation."""
        while self._steps and self._due_ns(self._steps[-1]) <= now_ns:
            step = self._steps.pop()
            due_ns = self._due_ns(step)
            self._simulation.advance(due_ns)
            self.handle(step.request, due_ns)
        self._simulation.advance(now_ns)

    def handle(self, request: q.Asked, now_ns: int) -> Reply:
        """Apply one request; a refused one changes nothing."""
        if isinstance(request, q.GetTruth):
            return Reply(ok=True, truth=self._simulation.truth(now_ns))
        error = self._inject(request, now_ns)
        self._simulation.record(Disturbed(mono_ns=now_ns, request=request, error=error))
        return Reply(ok=not error, error=error)

    def _due_ns(self, step: q.Step) -> int:
        return self._start_ns + round(step.at * NS_PER_S)

    def _inject(self, request: q.Asked, now_ns: int) -> str:
        """Return the reason of a refusal, empty when done."""
        match request:
            case q.Place():
                return self._place(request.pose, now_ns)
            case q.AddBox():
                return self._rebuild(self._simulation.world.with_box(request.box), now_ns)
            case q.RemoveBox():
                return self._remove(request.name, now_ns)
            case q.Wire():
                self._wire(request)
            case q.Mute():
                self._simulation.output.muted = _kinds(request.reports)
            case q.Lose():
                self._simulation.output.lose(_kinds(request.reports), request.every)
            case _:
                self._inject_board(request, now_ns)
        return ""

    def _inject_board(self, request: q.Asked, now_ns: int) -> None:
        simulation = self._simulation
        match request:
            case q.Bumper():
                simulation.pressed_by_hand = request.pressed
                simulation.update_bumper(now_ns)
            case q.Sonar():
                simulation.sonars.inject(request)
            case q.Driver():
                simulation.set_driver(DRIVER_SIDES[request.side], request.bits, now_ns)
            case q.Freeze():
                simulation.freeze(request.seconds, now_ns)
            case q.PowerCycle():
                simulation.power_cycle(request.seconds, now_ns)
            case q.Flood():
                simulation.flood(request.rate, request.seconds, request.garbage, now_ns)
            case q.Firmware():  # pragma: no branch - there is no other
                settings = simulation.output.settings
                simulation.output.settings = replace(settings, **msgspec.structs.asdict(request))

    def _wire(self, faults: q.Wire) -> None:
        if faults.direction in ("to_pc", "both"):
            self._simulation.to_pc.faults = faults
        if faults.direction in ("to_board", "both"):
            self._simulation.to_board.faults = faults

    def _place(self, pose: Pose, now_ns: int) -> str:
        simulation = self._simulation
        if simulation.world.blocks(simulation.body, pose):
            return f"an obstacle is at x {pose.x:g}, y {pose.y:g}"
        simulation.pose, simulation.twist = pose, STILL
        simulation.update_bumper(now_ns)
        return ""

    def _rebuild(self, world: World, now_ns: int) -> str:
        simulation = self._simulation
        if world.blocks(simulation.body, simulation.pose):
            return "an obstacle would overlap the vehicle"
        simulation.world = world
        simulation.update_bumper(now_ns)
        return ""

    def _remove(self, name: str, now_ns: int) -> str:
        names = [box.name for box in self._simulation.world.boxes]
        if name not in names:
            return f"no box is called {name!r}; there are: {', '.join(names) or 'none'}"
        return self._rebuild(self._simulation.world.without(name), now_ns)


def _kinds(names: tuple[q.ReportName, ...]) -> frozenset[type[Frame]]:
    return frozenset(REPORTS[name] for name in names)
