"""Frames from the main board to the PC, one frozen struct each.

Packed and little-endian (manual 2.2 to 2.7; the LED answer is not in the manual):

====== =========================== =====================================================
id     name                        payload
====== =========================== =====================================================
0x7426 motion                      u16 linear, u16 angular, sign-magnitude
0x7600 distance and heading        s32 mm, s32 0.1 deg, two's complement
0x7601 ultrasonic                  u16 x 8 mm
0x7602 bumper                      u8 0 clear, anything else hit
0x7603 ultrasonic emergency brake  u8 0 off, 1 on
0x7604 bumper emergency brake      u8 0 off, 1 on
0x7605 motor driver                u8 side, u32 fault bits
0x7503 LED                         u8 0x55 done, 0xAA failed
====== =========================== =====================================================

``VelocityReport`` is sent unsolicited and continuously, ``DriverReport`` on a query and on a
fault; the others answer a query.
"""

import struct
from typing import Self

from common.wire.frame import (
    SIDE,
    SWITCH,
    VELOCITY,
    Field,
    Frame,
    Side,
    by_opening,
    refusal,
)

SONAR_FAULT_MM = 0xFFFF


class VelocityReport(Frame, frozen=True):
    """Board to PC, unsolicited and continuous: the measured velocity (manual 2.2)."""

    ID = 0x7426
    FIELDS = (VELOCITY, VELOCITY)

    linear_mmps: int
    angular_raw: int


class DistanceReport(Frame, frozen=True):
    """Board to PC: distance and heading counted since power-on (manual 2.3)."""

    ID = 0x7600
    FIELDS = (Field("i", -(2**31), 2**31 - 1), Field("i", -1800, 1800))

    distance_mm: int  # forward positive
    heading_ddeg: int  # 0.1 deg, counter-clockwise positive


class UltrasonicReport(Frame, frozen=True):
    """Board to PC: eight ranges, counted clockwise from the left; 0xFFFF is a faulty sensor."""

    ID = 0x7601
    FIELDS = (Field("H", 0, 0xFFFF),) * 8

    # left, front-left, front, front-right, right, rear-right, rear, rear-left
    ranges_mm: tuple[int, ...]

    def __post_init__(self) -> None:
        try:
            self.to_bytes()  # takes half the time of comparing each value
        except struct.error:
            raise refusal("ranges_mm", self.ranges_mm, "8 of 0..65535") from None

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(*self.ranges_mm)

    @classmethod
    def from_wire(cls, numbers: tuple[int, ...]) -> Self:
        """Decode the eight ranges."""
        return cls(numbers)


class BumperReport(Frame, frozen=True):
    """Board to PC: on while the bumper is pressed (manual 2.4).

    The manual defines 0 and 1. Any other byte counts as pressed, the safe side.
    """

    ID = 0x7602
    FIELDS = (SWITCH,)

    on: bool

    @classmethod
    def from_wire(cls, numbers: tuple[int, ...]) -> Self:
        """Decode it from its byte."""
        return cls(numbers[0] != 0)


class UltrasonicBrakeReport(Frame, frozen=True):
    """Board to PC: the confirmation of ``UltrasonicBrakeSet`` (manual 2.5)."""

    ID = 0x7603
    FIELDS = (SWITCH,)

    on: bool


class BumperBrakeReport(Frame, frozen=True):
    """Board to PC: the confirmation of ``BumperBrakeSet`` (manual 2.6)."""

    ID = 0x7604
    FIELDS = (SWITCH,)

    on: bool


class DriverReport(Frame, frozen=True):
    """Board to PC, on a query and unsolicited on a fault (manual 2.7).

    Bits: 0 over-current, 1 over-voltage, 2 encoder, 3 under-voltage, 4 overload, 5..31 reserved.
    """

    ID = 0x7605
    FIELDS = (SIDE, Field("I", 0, 2**32 - 1))

    side: Side
    fault_bits: int


class LedReport(Frame, frozen=True):
    """Board to PC: whether the lamp was set."""

    ID = 0x7503
    FIELDS = (Field(meaning={0x55: True, 0xAA: False}),)

    done: bool


# All frames from the board, by their opening.
FROM_BOARD = by_opening(
    VelocityReport, DistanceReport, UltrasonicReport, BumperReport,
    UltrasonicBrakeReport, BumperBrakeReport, DriverReport, LedReport,
)  # fmt: skip
