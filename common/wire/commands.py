"""What the PC sends to the main board, one frozen dataclass per frame.

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

from dataclasses import dataclass
from enum import IntEnum
from struct import Struct
from typing import Self

from common.wire.frame import (
    Frame,
    Side,
    Switch,
    by_id,
    check,
    from_sign_magnitude,
    to_side,
    to_sign_magnitude,
)


class MotionKind(IntEnum):
    """What a motion command asks of the board (manual 2.2)."""

    STOP = 0  # coasts to a stop, with a ramp
    RUN = 1  # follows the velocities
    BREAK = 2  # stops at once; the manual's own spelling


@dataclass(frozen=True, slots=True)
class MotionCommand(Frame):
    """PC to board: stop, run or break (manual 2.2)."""

    ID = 0x7426
    LAYOUT = Struct("<BHH")

    kind: MotionKind
    linear_mmps: int = 0  # forward positive
    angular_raw: int = 0  # counter-clockwise positive; the unit is a setting, 0.1 deg/s by default

    def __post_init__(self) -> None:
        to_sign_magnitude(self.linear_mmps)
        to_sign_magnitude(self.angular_raw)

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(
            self.kind, to_sign_magnitude(self.linear_mmps), to_sign_magnitude(self.angular_raw)
        )

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload; raise ``WireError`` when it is none."""
        kind, linear, angular = cls.unpack(payload)
        check(kind <= MotionKind.BREAK, "motion command", kind, "0 STOP, 1 RUN, 2 BREAK")
        return cls(MotionKind(kind), from_sign_magnitude(linear), from_sign_magnitude(angular))


@dataclass(frozen=True, slots=True)
class DistanceQuery(Frame):
    """PC to board: how far and which way since power-on (manual 2.3)."""

    ID = 0x7600


@dataclass(frozen=True, slots=True)
class UltrasonicQuery(Frame):
    """PC to board: the eight ranges (manual 2.3, its second of that number)."""

    ID = 0x7601


@dataclass(frozen=True, slots=True)
class BumperQuery(Frame):
    """PC to board: is the bumper pressed (manual 2.4)."""

    ID = 0x7602


@dataclass(frozen=True, slots=True)
class UltrasonicBrakeSet(Switch):
    """PC to board: the board's own stop on a near echo, on or off (manual 2.5)."""

    ID = 0x7603


@dataclass(frozen=True, slots=True)
class BumperBrakeSet(Switch):
    """PC to board: the board's own stop on a bumper hit, on or off (manual 2.6)."""

    ID = 0x7604


@dataclass(frozen=True, slots=True)
class DriverQuery(Frame):
    """PC to board: the faults of one motor driver (manual 2.7)."""

    ID = 0x7605
    LAYOUT = Struct("<B")

    side: Side

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(self.side)

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload; raise ``WireError`` when it is none."""
        (side,) = cls.unpack(payload)
        return cls(to_side(side))


@dataclass(frozen=True, slots=True)
class LedSet(Frame):
    """PC to board: how one lamp channel shines; times and speed in the board's own units."""

    ID = 0x7503
    LAYOUT = Struct("<9B")

    channel: int
    mode: int
    on_lightness: int  # 0..10
    on_time: int
    off_time: int
    flash_lightness: int
    speed: int
    lightness_min: int
    lightness_max: int

    def __post_init__(self) -> None:
        for name in self.__match_args__:
            value = getattr(self, name)
            check(0 <= value <= 0xFF, name, value, "0..255")
        check(self.on_lightness <= 10, "on_lightness", self.on_lightness, "0..10")

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(*(getattr(self, name) for name in self.__match_args__))


# What the board may be sent, by the id in the header.
TO_BOARD = by_id(
    MotionCommand, DistanceQuery, UltrasonicQuery, BumperQuery,
    UltrasonicBrakeSet, BumperBrakeSet, DriverQuery, LedSet,
)  # fmt: skip
