"""Requests to the simulated vehicle, from the control socket or a script.

A request is a JSON object whose ``do`` names it: ``{"do": "bumper", "pressed": true}``. A script
is a TOML file of the same requests, each ``at`` a number of seconds after the start::

    [[steps]]
    at = 2.0
    request = { do = "freeze", seconds = 0.5 }
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from common.motion import Command
from sim.geometry import Pose
from sim.world import Angle, Box, Coordinate

SonarName = Literal[
    "left", "front_left", "front", "front_right", "right", "rear_right", "rear", "rear_left"
]
ReportName = Literal["velocity", "mileage", "ultrasonic", "bumper", "driver"]
Where = Literal["asked", "first", "second", "both"]  # of the PC's two ports
Hits = Literal["answers", "asked", "first", "second", "both"]  # "answers": where answers go
Port = Literal["first", "second", "both"]
Seconds = Annotated[float, Meta(ge=0.0, le=3600.0)]
Chance = Annotated[float, Meta(ge=0.0, le=1.0)]


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
    """Suppress these reports, solicited or not; no reports: suppress none."""

    reports: tuple[ReportName, ...] = ()


class Firmware(Request, frozen=True, kw_only=True, tag="firmware"):
    """Make the board deviate from the manual; fields left out mean the default."""

    answers: Where = "asked"  # where answers go: to the port that asked, by default
    hits: Hits = "answers"  # where reports of a pressed bumper go
    echoes: bool = True  # whether it echoes its emergency brake switches
    ignores: tuple[Command, ...] = ()  # motion commands that it does not obey


class Lose(Request, frozen=True, kw_only=True, tag="lose"):
    """Drop every n-th datagram with one of these reports; no reports: none."""

    reports: tuple[ReportName, ...] = ()
    every: Annotated[int, Meta(ge=1)] = 3


class Flood(Request, frozen=True, kw_only=True, tag="flood"):
    """Make the board send this many extra datagrams a second, for a time."""

    rate: Annotated[int, Meta(ge=100, le=100_000)] = 20_000
    seconds: Seconds = 1.0
    garbage: bool = False  # otherwise valid velocity reports


class Wire(Request, frozen=True, kw_only=True, tag="wire"):
    """Cable faults from now on, each with its probability; defaults mean none."""

    direction: Literal["to_pc", "to_board", "both"] = "both"
    port: Port = "both"  # of the PC's two, the one with these faults
    drop: Chance = 0.0
    duplicate: Chance = 0.0
    reorder: Chance = 0.0  # delayed until later datagrams have overtaken it
    corrupt: Chance = 0.0  # one to three bits flipped
    join: Chance = 0.0  # joined with the next one in one datagram
    foreign: Chance = 0.0  # sent from an address that is not the sender's own
    delay: Annotated[float, Meta(ge=0.0, le=60.0)] = 0.0  # s
    jitter: Annotated[float, Meta(ge=0.0, le=60.0)] = 0.0  # s, maximum additional delay
    rate: Annotated[float, Meta(ge=1e3)] | None = None  # bit/s; unlimited without any
    queue: Annotated[float, Meta(ge=2048)] = 65536  # bytes of the queue; more are dropped


class Place(Request, frozen=True, kw_only=True, tag="place"):
    """Place the vehicle, at standstill; refused where an obstacle is."""

    x: Coordinate  # m
    y: Coordinate  # m
    heading: Angle = 0.0  # rad

    @property
    def pose(self) -> Pose:
        """The pose."""
        return Pose(self.x, self.y, self.heading)


class AddBox(Request, frozen=True, kw_only=True, tag="add_box"):
    """Add a box to the world; refused where the vehicle is."""

    box: Box


class RemoveBox(Request, frozen=True, kw_only=True, tag="remove_box"):
    """Remove the box of that name."""

    name: str


class GetTruth(Request, frozen=True, kw_only=True, tag="truth"):
    """Query the true state; changes nothing."""


Asked = (
    Bumper | Sonar | Driver | Freeze | PowerCycle | Mute | Firmware | Lose | Flood | Wire
    | Place | AddBox | RemoveBox | GetTruth
)  # fmt: skip


class Step(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One step of a script."""

    at: Seconds  # after the start
    request: Asked


class Script(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A fault script; steps may be in any order."""

    steps: tuple[Step, ...] = ()
