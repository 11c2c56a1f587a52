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
from struct import Struct
from typing import Self

from common.wire.frame import (
    MAGNITUDE_MAX,
    Frame,
    Side,
    Switch,
    by_opening,
    from_sign_magnitude,
    refusal,
    to_side,
    to_sign_magnitude,
    too_fast,
)

SONAR_FAULT_MM = 0xFFFF
HEADING_MAX_DDEG = 1800
LED_DONE = 0x55
LED_FAILED = 0xAA


class VelocityReport(Frame, frozen=True):
    """Board to PC, unsolicited and continuous: the measured velocity (manual 2.2)."""

    ID = 0x7426
    LAYOUT = Struct("<HH")

    linear_mmps: int
    angular_raw: int

    def __post_init__(self) -> None:
        if abs(self.linear_mmps) > MAGNITUDE_MAX or abs(self.angular_raw) > MAGNITUDE_MAX:
            raise too_fast(self.linear_mmps, self.angular_raw)

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(
            to_sign_magnitude(self.linear_mmps), to_sign_magnitude(self.angular_raw)
        )

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode both velocities."""
        linear, angular = values
        return cls(from_sign_magnitude(linear), from_sign_magnitude(angular))


class DistanceReport(Frame, frozen=True):
    """Board to PC: distance and heading counted since power-on (manual 2.3)."""

    ID = 0x7600
    LAYOUT = Struct("<ii")

    distance_mm: int  # forward positive
    heading_ddeg: int  # 0.1 deg, counter-clockwise positive, -1800..1800

    def __post_init__(self) -> None:
        if not -(2**31) <= self.distance_mm < 2**31:
            raise refusal("distance", self.distance_mm, "32 bits")
        if not -HEADING_MAX_DDEG <= self.heading_ddeg <= HEADING_MAX_DDEG:
            raise refusal("heading", self.heading_ddeg, "-1800..1800")


class UltrasonicReport(Frame, frozen=True):
    """Board to PC: eight ranges, counted clockwise from the left; 0xFFFF is a faulty sensor."""

    ID = 0x7601
    LAYOUT = Struct("<8H")

    # left, front-left, front, front-right, right, rear-right, rear, rear-left
    ranges_mm: tuple[int, ...]

    def __post_init__(self) -> None:
        try:
            self.LAYOUT.pack(*self.ranges_mm)  # takes half the time of comparing each value
        except struct.error:
            raise refusal("ranges_mm", self.ranges_mm, "8 of 0..65535") from None

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(*self.ranges_mm)

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode the eight ranges."""
        return cls(values)


class BumperReport(Switch, frozen=True):
    """Board to PC: on while the bumper is pressed (manual 2.4).

    The manual defines 0 and 1. Any other byte counts as pressed, the safe side.
    """

    ID = 0x7602

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode it from its byte."""
        (value,) = values
        return cls(value != 0)


class UltrasonicBrakeReport(Switch, frozen=True):
    """Board to PC: the echo of ``UltrasonicBrakeSet`` (manual 2.5)."""

    ID = 0x7603


class BumperBrakeReport(Switch, frozen=True):
    """Board to PC: the echo of ``BumperBrakeSet`` (manual 2.6)."""

    ID = 0x7604


class DriverReport(Frame, frozen=True):
    """Board to PC, on a query and unsolicited on a fault (manual 2.7).

    Bits: 0 over-current, 1 over-voltage, 2 encoder, 3 under-voltage, 4 overload, 5..31 reserved.
    """

    ID = 0x7605
    LAYOUT = Struct("<BI")

    side: Side
    fault_bits: int

    def __post_init__(self) -> None:
        if not 0 <= self.fault_bits < 2**32:
            raise refusal("fault bits", self.fault_bits, "32 bits")

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode side and bits; raise ``WireError`` for an unknown side."""
        side, bits = values
        return cls(to_side(side), bits)


class LedReport(Frame, frozen=True):
    """Board to PC: whether the lamp was set."""

    ID = 0x7503
    LAYOUT = Struct("<B")

    done: bool

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(LED_DONE if self.done else LED_FAILED)

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode the answer; raise ``WireError`` for an unknown one."""
        (value,) = values
        if value not in (LED_DONE, LED_FAILED):
            raise refusal("LED answer", hex(value), "0x55 or 0xaa")
        return cls(value == LED_DONE)


# All frames from the board, by their opening.
FROM_BOARD = by_opening(
    VelocityReport, DistanceReport, UltrasonicReport, BumperReport,
    UltrasonicBrakeReport, BumperBrakeReport, DriverReport, LedReport,
)  # fmt: skip
