"""What the simulated vehicle writes down while it runs: one JSON object a line, named by ``event``.

``mono_ns`` is the host's monotonic clock, the same that the services read, so that a frame here and
a message there can be told apart in time. SI units and radians, in the world's frame.
"""

import msgspec
from msgspec import Struct

from common import motion
from sim.requests import Asked


class Record(Struct, frozen=True, kw_only=True, tag_field="event"):
    """One line."""

    mono_ns: int


class Command(Record, frozen=True, kw_only=True, tag="command"):
    """The board took a motion command; queries are only counted."""

    kind: motion.Command
    linear: float  # m/s
    angular: float  # rad/s


class BumperSent(Record, frozen=True, kw_only=True, tag="bumper_sent"):
    """The first frame has left that says this of the bumper."""

    pressed: bool


class Truth(Record, frozen=True, kw_only=True, tag="truth"):
    """How things really are, whatever the board reports."""

    x: float
    y: float
    heading: float  # not wrapped
    linear: float
    angular: float
    distance: float  # m, driven since the start, either way; no power cycle clears it
    clearance: float | None  # m, to the nearest surface that sonar sees; None without any
    contact: bool  # something presses the bumper strip
    pressed: bool  # what the board knows: contact, or by hand
    wheels: tuple[float, ...]  # rad: front left, front right, rear left, rear right
    command: Command  # the one that the board holds
    braking: bool  # one of the board's own emergency brakes overrules that command
    ultrasonic_brake: bool
    bumper_brake: bool
    silent: bool  # the board is frozen or has no power


class Power(Record, frozen=True, kw_only=True, tag="power"):
    """The board lost its power, or is back."""

    on: bool


class Disturbed(Record, frozen=True, kw_only=True, tag="fault"):
    """Someone asked for something that is no part of driving; ``error`` says why it was refused."""

    request: Asked
    error: str = ""


Line = Command | BumperSent | Truth | Power | Disturbed

_lines = msgspec.json.Decoder(Line)


def read(trace: bytes) -> list[Line]:
    """Read a trace; the end of one that is still being written may be half a line: left out."""
    return [_lines.decode(line) for line in trace.split(b"\n")[:-1]]
