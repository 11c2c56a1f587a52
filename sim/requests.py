"""Requests to the simulated vehicle, from the control socket.

A request is a JSON object whose ``do`` names it: ``{"do": "bumper", "pressed": true}``.
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from common.wire import reports as r
from common.wire.frame import Frame
from sim import model
from sim.world import Angle, Coordinate

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


class Sonar(Request, frozen=True, kw_only=True, tag="sonar"):
    """Make one sonar faulty, stuck at its last range, or report this range; no field: normal."""

    name: SonarName
    fault: bool = False
    stuck: bool = False
    range: Annotated[float, Meta(ge=0.0, le=60.0)] | None = None  # m


class Driver(Request, frozen=True, kw_only=True, tag="driver"):
    """Set the fault bits of one motor driver (manual 2.7); it keeps driving, the worst case."""

    side: Literal["left", "right"]
    bits: Annotated[int, Meta(ge=0, le=0xFFFFFFFF)]


class Freeze(Request, frozen=True, kw_only=True, tag="freeze"):
    """Make the board neither receive nor send for a time; the wheels keep moving."""

    seconds: Seconds


class PowerCycle(Request, frozen=True, kw_only=True, tag="power_cycle"):
    """Power-cycle the board: counters, switches, command and faults are reset."""

    seconds: Seconds = 1.0  # until it sends again


class Mute(Request, frozen=True, kw_only=True, tag="mute"):
    """Suppress every n-th of these reports, solicited or not; no reports: suppress none."""

    reports: tuple[ReportName, ...] = ()
    every: Annotated[int, Meta(ge=1)] = 1


class Firmware(model.Firmware, frozen=True, kw_only=True, tag_field="do", tag="firmware"):
    """Make the board deviate from the manual; fields left out mean the default."""


class Flood(Request, frozen=True, kw_only=True, tag="flood"):
    """Make the board send extra velocity reports, or another datagram, for a time."""

    seconds: Seconds = 1.0
    rate: Annotated[int, Meta(ge=100, le=20_000)] = 20_000  # a second, in hundreds
    datagram: bytes = b""  # Base64 in JSON; empty: a velocity report


class Wire(model.Line, frozen=True, kw_only=True, tag_field="do", tag="wire"):
    """Cable faults from now on; fields left out mean none."""

    direction: Literal["to_pc", "to_board", "both"] = "both"


class Place(Request, frozen=True, kw_only=True, tag="place"):
    """Place the vehicle, at standstill; refused where an obstacle is."""

    x: Coordinate  # m
    y: Coordinate  # m
    heading: Angle = 0.0  # rad


class Person(Request, frozen=True, kw_only=True, tag="person"):
    """Let a person walk from here, or stand, and go away after a time; at most one at once.

    A person does not walk into the vehicle; refused where the vehicle is.
    """

    x: Coordinate  # m
    y: Coordinate  # m
    heading: Angle = 0.0  # rad
    speed: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.0  # m/s
    seconds: Seconds


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
    | Person
    | GetTruth
)
