"""What can be done to the simulated vehicle from outside, by hand or by script.

A request is a JSON object whose ``do`` names it: ``{"do": "bumper", "pressed": true}``. A script
is a TOML file of the same requests, each ``at`` so many seconds after the start::

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
Seconds = Annotated[float, Meta(ge=0.0, le=3600.0)]
Chance = Annotated[float, Meta(ge=0.0, le=1.0)]


class Request(Struct, frozen=True, kw_only=True, tag_field="do", forbid_unknown_fields=True):
    """One thing to do."""


class Bumper(Request, frozen=True, kw_only=True, tag="bumper"):
    """Press the bumper strip by hand, or let go of it; an obstacle presses it as well."""

    pressed: bool


class Sonar(Request, frozen=True, kw_only=True, tag="sonar"):
    """Let one sonar be faulty, stuck at its last range, or see this range; well without any."""

    name: SonarName
    fault: bool = False
    stuck: bool = False
    range: Annotated[float, Meta(ge=0.0, le=60.0)] | None = None  # m


class Driver(Request, frozen=True, kw_only=True, tag="driver"):
    """Set the fault bits of one motor driver (manual 2.7); it drives on, which is the worst."""

    side: Literal["left", "right"]
    bits: Annotated[int, Meta(ge=0, le=0xFFFFFFFF)]


class Freeze(Request, frozen=True, kw_only=True, tag="freeze"):
    """Let the board neither hear nor say anything for a time; the wheels go on."""

    seconds: Seconds


class PowerCycle(Request, frozen=True, kw_only=True, tag="power_cycle"):
    """Take the board's power away, and give it back: counters, switches, command, faults at 0."""

    seconds: Seconds = 1.0  # until it speaks again


class Mute(Request, frozen=True, kw_only=True, tag="mute"):
    """Let the board not say these reports any more, asked or not; it says all without any."""

    reports: tuple[ReportName, ...] = ()


class Firmware(Request, frozen=True, kw_only=True, tag="firmware"):
    """Make the board deviate from the manual; fields left out mean the default."""

    answers: Where = "asked"  # where answers go: to the port that asked, by default
    hits: Where | None = None  # where reports of a pressed bumper go; None: as answers
    echoes: bool = True  # whether it echoes its emergency brake switches
    ignores: tuple[Command, ...] = ()  # motion commands that it does not obey


class Lose(Request, frozen=True, kw_only=True, tag="lose"):
    """Drop every n-th datagram with one of these reports; no reports: none."""

    reports: tuple[ReportName, ...] = ()
    every: Annotated[int, Meta(ge=1)] = 3


class Flood(Request, frozen=True, kw_only=True, tag="flood"):
    """Let the board send that many datagrams a second besides, for a time."""

    rate: Annotated[int, Meta(ge=100, le=100_000)] = 20_000
    seconds: Seconds = 1.0
    garbage: bool = False  # otherwise its velocity, true each time


class Wire(Request, frozen=True, kw_only=True, tag="wire"):
    """What happens to datagrams from now on, each with its chance; all well when left out."""

    direction: Literal["to_pc", "to_board", "both"] = "both"
    drop: Chance = 0.0
    duplicate: Chance = 0.0
    reorder: Chance = 0.0  # held back until some later ones have overtaken it
    corrupt: Chance = 0.0  # one to three bits flipped
    join: Chance = 0.0  # put into one datagram with the next one
    foreign: Chance = 0.0  # sent from an address that is not the sender's own
    delay: Annotated[float, Meta(ge=0.0, le=60.0)] = 0.0  # s
    jitter: Annotated[float, Meta(ge=0.0, le=60.0)] = 0.0  # s, at most that much more
    rate: Annotated[float, Meta(ge=1e3)] | None = None  # bit/s; as fast as it comes without any
    queue: Annotated[float, Meta(ge=2048)] = 65536  # bytes that may wait for it; more are dropped


class Place(Request, frozen=True, kw_only=True, tag="place"):
    """Put the vehicle somewhere, standing; refused where something is in the way."""

    x: Coordinate  # m
    y: Coordinate  # m
    heading: Angle = 0.0  # rad

    @property
    def pose(self) -> Pose:
        """Return where."""
        return Pose(self.x, self.y, self.heading)


class AddBox(Request, frozen=True, kw_only=True, tag="add_box"):
    """Put a box into the world; refused where the vehicle is."""

    box: Box


class RemoveBox(Request, frozen=True, kw_only=True, tag="remove_box"):
    """Take the box of that name away."""

    name: str


class AskTruth(Request, frozen=True, kw_only=True, tag="truth"):
    """Ask how things really are; changes nothing."""


Asked = (
    Bumper | Sonar | Driver | Freeze | PowerCycle | Mute | Firmware | Lose | Flood | Wire
    | Place | AddBox | RemoveBox | AskTruth
)  # fmt: skip


class Step(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A request of a script."""

    at: Seconds  # after the start
    request: Asked


class Script(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What will happen by itself; steps may stand in any order."""

    steps: tuple[Step, ...] = ()
