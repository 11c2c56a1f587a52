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

from common.wire.frame import (
    OCTET,
    SIDE,
    SWITCH,
    VELOCITY,
    Field,
    Frame,
    Side,
    by_opening,
)


class MotionKind(IntEnum):
    """Kind of a motion command (manual 2.2)."""

    STOP = 0  # coasts to a stop, with a ramp
    RUN = 1  # follows the velocities
    BREAK = 2  # stops at once; the manual's own spelling


KIND = Field(meaning={kind.value: kind for kind in MotionKind})


class MotionCommand(Frame, frozen=True):
    """PC to board: stop, run or break (manual 2.2)."""

    ID = 0x7426
    FIELDS = (KIND, VELOCITY, VELOCITY)

    kind: MotionKind
    linear_mmps: int = 0  # forward positive
    angular_raw: int = 0  # counter-clockwise positive; the unit is a setting, 0.1 deg/s by default


class DistanceQuery(Frame, frozen=True):
    """PC to board: distance and heading since power-on (manual 2.3)."""

    ID = 0x7600


class UltrasonicQuery(Frame, frozen=True):
    """PC to board: the eight ranges (manual 2.3, the second section 2.3)."""

    ID = 0x7601


class BumperQuery(Frame, frozen=True):
    """PC to board: the bumper state (manual 2.4)."""

    ID = 0x7602


class UltrasonicBrakeSet(Frame, frozen=True):
    """PC to board: the board's own stop on a near echo, on or off (manual 2.5)."""

    ID = 0x7603
    FIELDS = (SWITCH,)

    on: bool


class BumperBrakeSet(Frame, frozen=True):
    """PC to board: the board's own stop on a bumper hit, on or off (manual 2.6)."""

    ID = 0x7604
    FIELDS = (SWITCH,)

    on: bool


class DriverQuery(Frame, frozen=True):
    """PC to board: the faults of one motor driver (manual 2.7)."""

    ID = 0x7605
    FIELDS = (SIDE,)

    side: Side


class LedSet(Frame, frozen=True):
    """PC to board: setting of one lamp channel; times and speed in the board's own units."""

    ID = 0x7503
    FIELDS = (OCTET, OCTET, Field("B", 0, 10), *[OCTET] * 6)

    channel: int
    mode: int
    on_lightness: int
    on_time: int
    off_time: int
    flash_lightness: int
    speed: int
    lightness_min: int
    lightness_max: int


# All frames to the board, by their opening.
TO_BOARD = by_opening(
    MotionCommand, DistanceQuery, UltrasonicQuery, BumperQuery,
    UltrasonicBrakeSet, BumperBrakeSet, DriverQuery, LedSet,
)  # fmt: skip
