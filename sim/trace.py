"""Trace of the simulated vehicle: one JSON object a line, named by ``event``.

``mono_ns`` is the host's monotonic clock, the same that the services read, so that times of frames
here and of messages there can be compared. SI units and radians, in the world's frame.
"""

import msgspec
from msgspec import Struct

from sim.requests import Asked
from t2 import messages


class Record(Struct, frozen=True, kw_only=True, tag_field="event"):
    """One line."""

    mono_ns: int


class Command(Record, frozen=True, kw_only=True, tag="command"):
    """The board received a motion command; queries are only counted."""

    kind: messages.Command
    linear: float  # m/s
    angular: float  # rad/s


class BumperSent(Record, frozen=True, kw_only=True, tag="bumper_sent"):
    """The first frame with this bumper state was sent."""

    pressed: bool


class Truth(Record, frozen=True, kw_only=True, tag="truth"):
    """The true state, whatever the board reports."""

    x: float
    y: float
    heading: float  # not wrapped
    linear: float
    angular: float
    distance: float  # m, driven since the start, in both directions; survives power cycles
    clearance: float | None  # m, to the nearest surface that sonar sees; None without any
    contact: bool  # something presses the bumper strip
    pressed: bool  # the bumper as the board senses it: contact, or by hand
    command: Command  # the current command of the board
    person: tuple[float, float] | None = None  # x and y of the person who walks there


class Power(Record, frozen=True, kw_only=True, tag="power"):
    """The board lost its power, or has it back."""

    on: bool


class Disturbed(Record, frozen=True, kw_only=True, tag="fault"):
    """A request was applied or refused; ``error`` is the reason of a refusal."""

    request: Asked
    error: str = ""


Line = Command | BumperSent | Truth | Power | Disturbed

_lines = msgspec.json.Decoder(Line)


def read(trace: bytes) -> list[Line]:
    """Parse a trace; an incomplete last line is ignored."""
    return [_lines.decode(line) for line in trace.split(b"\n")[:-1]]
