"""Frames from the PC to the main board, one frozen struct each.

Packed and little-endian (manual 2.2 to 2.7; the LED command is not in the manual):

====== =========================== =====================================================
id     name                        payload
====== =========================== =====================================================
0x7426 motion                      u8 command, u16 linear, u16 angular, sign-magnitude
0x7600 distance and heading        -
0x7601 ultrasonic                  -
0x7602 bumper                      -
0x7603 ultrasonic emergency brake  u8 0 off, 1 on
0x7604 bumper emergency brake      u8 0 off, 1 on
0x7605 motor driver                u8 side
0x7503 LED                         u8 x 9
====== =========================== =====================================================
"""

from enum import IntEnum
from struct import Struct
from typing import ClassVar, Self

from common.wire.frame import (
    SIGNED_15_BITS,
    Frame,
    Limits,
    Side,
    Switch,
    by_opening,
    chosen,
    from_sign_magnitude,
    side_of,
    to_sign_magnitude,
)


class MotionKind(IntEnum):
    """Kind of a motion command (manual 2.2)."""

    STOP = 0  # coasts to a stop, with a ramp
    RUN = 1  # follows the velocities
    BREAK = 2  # stops at once; the manual's own spelling


MOTION_KINDS = {kind.value: kind for kind in MotionKind}


class MotionCommand(Frame, frozen=True):
    """PC to board: stop, run or break (manual 2.2)."""

    ID = 0x7426
    LAYOUT = Struct("<BHH")
    LIMITS: ClassVar[Limits] = {"linear_mmps": SIGNED_15_BITS, "angular_raw": SIGNED_15_BITS}

    kind: MotionKind
    linear_mmps: int = 0  # forward positive
    angular_raw: int = 0  # counter-clockwise positive; the unit is a setting, 0.1 deg/s by default

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        linear, angular = to_sign_magnitude(self.linear_mmps), to_sign_magnitude(self.angular_raw)
        return self.LAYOUT.pack(self.kind, linear, angular)

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode kind and velocities; raise ``WireError`` for an unknown kind."""
        kind, linear, angular = values
        velocities = from_sign_magnitude(linear), from_sign_magnitude(angular)
        allowed = "0 STOP, 1 RUN, 2 BREAK"
        return cls(chosen("motion command", kind, MOTION_KINDS, allowed), *velocities)


class DistanceQuery(Frame, frozen=True):
    """PC to board: distance and heading since power-on (manual 2.3)."""

    ID = 0x7600


class UltrasonicQuery(Frame, frozen=True):
    """PC to board: the eight ranges (manual 2.3, the second section 2.3)."""

    ID = 0x7601


class BumperQuery(Frame, frozen=True):
    """PC to board: the bumper state (manual 2.4)."""

    ID = 0x7602


class UltrasonicBrakeSet(Switch, frozen=True):
    """PC to board: the board's own stop on a near echo, on or off (manual 2.5)."""

    ID = 0x7603


class BumperBrakeSet(Switch, frozen=True):
    """PC to board: the board's own stop on a bumper hit, on or off (manual 2.6)."""

    ID = 0x7604


class DriverQuery(Frame, frozen=True):
    """PC to board: the faults of one motor driver (manual 2.7)."""

    ID = 0x7605
    LAYOUT = Struct("<B")

    side: Side

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode the side; raise ``WireError`` for an unknown one."""
        return cls(side_of(values[0]))


class LedSet(Frame, frozen=True):
    """PC to board: setting of one lamp channel; times and speed in the board's own units."""

    ID = 0x7503
    LAYOUT = Struct("<9B")

    channel: int
    mode: int
    on_lightness: int
    on_time: int
    off_time: int
    flash_lightness: int
    speed: int
    lightness_min: int
    lightness_max: int


LedSet.LIMITS = dict.fromkeys(LedSet.__struct_fields__, (0, 0xFF)) | {"on_lightness": (0, 10)}

# All frames to the board, by their opening.
TO_BOARD = by_opening(
    MotionCommand, DistanceQuery, UltrasonicQuery, BumperQuery,
    UltrasonicBrakeSet, BumperBrakeSet, DriverQuery, LedSet,
)  # fmt: skip
