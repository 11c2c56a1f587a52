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
    refusal,
    side_of,
    to_sign_magnitude,
)

SONAR_FAULT_MM = 0xFFFF
LED_DONE, LED_FAILED = 0x55, 0xAA


class VelocityReport(Frame, frozen=True):
    """Board to PC, unsolicited and continuous: the measured velocity (manual 2.2)."""

    ID = 0x7426
    LAYOUT = Struct("<HH")
    LIMITS: ClassVar[Limits] = {"linear_mmps": SIGNED_15_BITS, "angular_raw": SIGNED_15_BITS}

    linear_mmps: int
    angular_raw: int

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        linear, angular = to_sign_magnitude(self.linear_mmps), to_sign_magnitude(self.angular_raw)
        return self.LAYOUT.pack(linear, angular)

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode both velocities."""
        return cls(*map(from_sign_magnitude, values))


class DistanceReport(Frame, frozen=True):
    """Board to PC: distance and heading counted since power-on (manual 2.3)."""

    ID = 0x7600
    LAYOUT = Struct("<ii")
    LIMITS: ClassVar[Limits] = {"distance_mm": (-(2**31), 2**31 - 1), "heading_ddeg": (-1800, 1800)}

    distance_mm: int  # forward positive
    heading_ddeg: int  # 0.1 deg, counter-clockwise positive


class UltrasonicReport(Frame, frozen=True):
    """Board to PC: eight ranges, counted clockwise from the left; 0xFFFF is a faulty sensor."""

    ID = 0x7601
    LAYOUT = Struct("<8H")

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
        return cls(values[0] != 0)


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
    LIMITS: ClassVar[Limits] = {"fault_bits": (0, 2**32 - 1)}

    side: Side
    fault_bits: int

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode side and bits; raise ``WireError`` for an unknown side."""
        side, bits = values
        return cls(side_of(side), bits)


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
        answers = {LED_DONE: True, LED_FAILED: False}
        return cls(chosen("LED answer", values[0], answers, "85 done, 170 failed"))


# All frames from the board, by their opening.
FROM_BOARD = by_opening(
    VelocityReport, DistanceReport, UltrasonicReport, BumperReport,
    UltrasonicBrakeReport, BumperBrakeReport, DriverReport, LedReport,
)  # fmt: skip
