"""What the main board sends to the PC, one frozen dataclass per frame.

Packed and little-endian (manual 2.2 to 2.7; the LED answer is not in the manual):

====== =========================== =====================================================
id     name                        payload
====== =========================== =====================================================
0x7426 motion                      u16 linear, u16 angular, sign-magnitude
0x7600 distance and heading        s32 mm, s32 0.1 deg, two's complement
0x7601 ultrasonic                  u16 x 8 mm
0x7602 bumper                      u8 0 clear, 1 hit
0x7603 ultrasonic emergency brake  u8 0 off, 1 on
0x7604 bumper emergency brake      u8 0 off, 1 on
0x7605 motor driver                u8 side, u32 fault bits
0x7503 LED                         u8 0x55 done, 0xAA failed
====== =========================== =====================================================

``VelocityReport`` comes unasked and continuously, ``DriverReport`` on a query and unasked on a
fault; the rest answers a query.
"""

from dataclasses import dataclass
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

SONAR_FAULT_MM = 0xFFFF
HEADING_MAX_DDEG = 1800
LED_DONE = 0x55
LED_FAILED = 0xAA


@dataclass(frozen=True, slots=True)
class VelocityReport(Frame):
    """Board to PC, unasked and continuous: the measured velocity (manual 2.2)."""

    ID = 0x7426
    LAYOUT = Struct("<HH")

    linear_mmps: int
    angular_raw: int

    def __post_init__(self) -> None:
        to_sign_magnitude(self.linear_mmps)
        to_sign_magnitude(self.angular_raw)

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(
            to_sign_magnitude(self.linear_mmps), to_sign_magnitude(self.angular_raw)
        )

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload; raise ``WireError`` when it is none."""
        linear, angular = cls.unpack(payload)
        return cls(from_sign_magnitude(linear), from_sign_magnitude(angular))


@dataclass(frozen=True, slots=True)
class DistanceReport(Frame):
    """Board to PC: distance and heading counted since power-on (manual 2.3)."""

    ID = 0x7600
    LAYOUT = Struct("<ii")

    distance_mm: int  # forward positive
    heading_ddeg: int  # 0.1 deg, counter-clockwise positive, -1800..1800

    def __post_init__(self) -> None:
        check(-(2**31) <= self.distance_mm < 2**31, "distance", self.distance_mm, "32 bits")
        limit = HEADING_MAX_DDEG
        check(-limit <= self.heading_ddeg <= limit, "heading", self.heading_ddeg, "-1800..1800")

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(self.distance_mm, self.heading_ddeg)


@dataclass(frozen=True, slots=True)
class UltrasonicReport(Frame):
    """Board to PC: eight ranges, counted clockwise from the left; 0xFFFF is a faulty sensor."""

    ID = 0x7601
    LAYOUT = Struct("<8H")

    # left, front-left, front, front-right, right, rear-right, rear, rear-left
    ranges_mm: tuple[int, int, int, int, int, int, int, int]

    def __post_init__(self) -> None:
        check(len(self.ranges_mm) == 8, "number of ranges", len(self.ranges_mm), "8")
        for value in self.ranges_mm:
            check(0 <= value <= 0xFFFF, "range", value, "0..65535")

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(*self.ranges_mm)

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload; raise ``WireError`` when it is none."""
        left, front_left, front, front_right, *rest = cls.unpack(payload)
        right, rear_right, rear, rear_left = rest
        return cls((left, front_left, front, front_right, right, rear_right, rear, rear_left))


@dataclass(frozen=True, slots=True)
class BumperReport(Switch):
    """Board to PC: on while the bumper is pressed (manual 2.4)."""

    ID = 0x7602


@dataclass(frozen=True, slots=True)
class UltrasonicBrakeReport(Switch):
    """Board to PC: the echo of that switch (manual 2.5)."""

    ID = 0x7603


@dataclass(frozen=True, slots=True)
class BumperBrakeReport(Switch):
    """Board to PC: the echo of that switch (manual 2.6)."""

    ID = 0x7604


@dataclass(frozen=True, slots=True)
class DriverReport(Frame):
    """Board to PC, on a query and unasked on a fault (manual 2.7).

    Bits: 0 over-current, 1 over-voltage, 2 encoder, 3 under-voltage, 4 overload, 5..31 reserved.
    """

    ID = 0x7605
    LAYOUT = Struct("<BI")

    side: Side
    fault_bits: int

    def __post_init__(self) -> None:
        check(0 <= self.fault_bits < 2**32, "fault bits", self.fault_bits, "32 bits")

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(self.side, self.fault_bits)

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload; raise ``WireError`` when it is none."""
        side, bits = cls.unpack(payload)
        return cls(to_side(side), bits)


@dataclass(frozen=True, slots=True)
class LedReport(Frame):
    """Board to PC: whether the lamp was set."""

    ID = 0x7503
    LAYOUT = Struct("<B")

    done: bool

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(LED_DONE if self.done else LED_FAILED)

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload; raise ``WireError`` when it is none."""
        (value,) = cls.unpack(payload)
        check(value in (LED_DONE, LED_FAILED), "LED answer", hex(value), "0x55 or 0xaa")
        return cls(value == LED_DONE)


# What the board may send, by the id in the header.
FROM_BOARD = by_id(
    VelocityReport, DistanceReport, UltrasonicReport, BumperReport,
    UltrasonicBrakeReport, BumperBrakeReport, DriverReport, LedReport,
)  # fmt: skip
