"""Requests to the simulated vehicle, from the control socket, and their effect.

A request is a JSON object whose ``do`` names it: ``{"do": "bumper", "pressed": true}``. ``_apply``
returns the reason of a refusal, if any; a refused request changes nothing.
"""

from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta, Struct

from common.motion import STILL
from common.wire import reports as r
from common.wire.frame import Frame, Side
from sim import model
from sim.geometry import Pose
from sim.world import Angle, Coordinate

if TYPE_CHECKING:
    from sim.simulation import Simulation

SonarName = Literal[
    "left", "front_left", "front", "front_right", "right", "rear_right", "rear", "rear_left"
]
ReportName = Literal["velocity", "mileage", "ultrasonic", "bumper", "driver"]
Seconds = Annotated[float, Meta(ge=0.0, le=3600.0)]

REPORTS: dict[ReportName, type[Frame]] = {
    "velocity": r.VelocityReport,
    "mileage": r.DistanceReport,
    "ultrasonic": r.UltrasonicReport,
    "bumper": r.BumperReport,
    "driver": r.DriverReport,
}


class Request(Struct, frozen=True, kw_only=True, tag_field="do", forbid_unknown_fields=True):
    """Base class of all requests."""


class Bumper(Request, frozen=True, kw_only=True, tag="bumper"):
    """Press or release the bumper strip by hand; an obstacle presses it as well."""

    pressed: bool

    def _apply(self, sim: "Simulation", now_ns: int) -> None:
        sim.pressed_by_hand = self.pressed
        sim.update_bumper(now_ns)


class Sonar(Request, frozen=True, kw_only=True, tag="sonar"):
    """Make one sonar faulty, stuck at its last range, or report this range; no field: normal."""

    name: SonarName
    fault: bool = False
    stuck: bool = False
    range: Annotated[float, Meta(ge=0.0, le=60.0)] | None = None  # m

    def _apply(self, sim: "Simulation", _: int) -> None:
        sim.sonars.inject(self)


class Driver(Request, frozen=True, kw_only=True, tag="driver"):
    """Set the fault bits of one motor driver (manual 2.7); it keeps driving, the worst case."""

    side: Literal["left", "right"]
    bits: Annotated[int, Meta(ge=0, le=0xFFFFFFFF)]

    def _apply(self, sim: "Simulation", now_ns: int) -> None:
        sim.set_driver(Side.LEFT if self.side == "left" else Side.RIGHT, self.bits, now_ns)


class Freeze(Request, frozen=True, kw_only=True, tag="freeze"):
    """Make the board neither receive nor send for a time; the wheels keep moving."""

    seconds: Seconds

    def _apply(self, sim: "Simulation", now_ns: int) -> None:
        sim.freeze(self.seconds, now_ns)


class PowerCycle(Request, frozen=True, kw_only=True, tag="power_cycle"):
    """Power-cycle the board: counters, switches, command and faults are reset."""

    seconds: Seconds = 1.0  # until it sends again

    def _apply(self, sim: "Simulation", now_ns: int) -> None:
        sim.power_cycle(self.seconds, now_ns)


class Mute(Request, frozen=True, kw_only=True, tag="mute"):
    """Suppress every n-th of these reports, solicited or not; no reports: suppress none."""

    reports: tuple[ReportName, ...] = ()
    every: Annotated[int, Meta(ge=1)] = 1

    def _apply(self, sim: "Simulation", _: int) -> None:
        sim.output.mute([REPORTS[name] for name in self.reports], self.every)


class Firmware(model.Firmware, frozen=True, kw_only=True, tag_field="do", tag="firmware"):
    """Make the board deviate from the manual; fields left out mean the default."""

    def _apply(self, sim: "Simulation", _: int) -> None:
        sim.output.firmware = self


class Flood(Request, frozen=True, kw_only=True, tag="flood"):
    """Make the board send this many extra datagrams a second, for a time."""

    rate: Annotated[int, Meta(ge=100, le=100_000)] = 20_000
    seconds: Seconds = 1.0
    garbage: bool = False  # otherwise valid velocity reports

    def _apply(self, sim: "Simulation", now_ns: int) -> None:
        sim.flood(self.rate, self.seconds, self.garbage, now_ns)


class Wire(model.Line, frozen=True, kw_only=True, tag_field="do", tag="wire"):
    """Cable faults from now on; fields left out mean none."""

    direction: Literal["to_pc", "to_board", "both"] = "both"

    def _apply(self, sim: "Simulation", _: int) -> None:
        if self.direction in ("to_pc", "both"):
            sim.to_pc.faults = self
        if self.direction in ("to_board", "both"):
            sim.to_board.faults = self


class Place(Request, frozen=True, kw_only=True, tag="place"):
    """Place the vehicle, at standstill; refused where an obstacle is."""

    x: Coordinate  # m
    y: Coordinate  # m
    heading: Angle = 0.0  # rad

    def _apply(self, sim: "Simulation", now_ns: int) -> str:
        pose = Pose(self.x, self.y, self.heading)
        if sim.world.blocks(sim.body, pose):
            return f"an obstacle is at x {self.x:g}, y {self.y:g}"
        sim.pose, sim.twist = pose, STILL
        sim.update_bumper(now_ns)
        return ""


class GetTruth(Request, frozen=True, kw_only=True, tag="truth"):
    """Query the true state; changes nothing."""


Asked = (
    Bumper
    | Sonar
    | Driver
    | Freeze
    | PowerCycle
    | Mute
    | Firmware
    | Flood
    | Wire
    | Place
    | GetTruth
)
