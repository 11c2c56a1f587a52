"""Frames of the main board: header, CRC-16/ARC over the payload, sign and magnitude."""

import struct
from dataclasses import dataclass
from typing import Literal

Kind = Literal["stop", "run", "brake"]

MOTION, DISTANCE, SONAR, BUMPER = 0x7426, 0x7600, 0x7601, 0x7602
SONAR_BRAKE, BUMPER_BRAKE, DRIVER, LED = 0x7603, 0x7604, 0x7605, 0x7503
NAMES = {
    MOTION: "motion", DISTANCE: "distance", SONAR: "sonar", BUMPER: "bumper",
    SONAR_BRAKE: "sonar_brake", BUMPER_BRAKE: "bumper_brake", DRIVER: "driver", LED: "led",
}  # fmt: skip
KINDS: tuple[Kind, Kind, Kind] = ("stop", "run", "brake")
MAGIC = b"GS"
HEADER = struct.Struct("<2sHHH")
DECIDEGREES_PER_RADIAN = 572.9577951308232


@dataclass(frozen=True)
class Command:
    """A motion command as the board received it."""

    at: float  # s, monotonic
    kind: Kind
    linear: float  # m/s
    angular: float  # rad/s

    @property
    def moves(self) -> bool:
        return self.kind == "run" and (self.linear != 0.0 or self.angular != 0.0)


def crc16(data: bytes) -> int:
    """Return CRC-16/ARC: reflected 0x8005, start 0, no final XOR."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def frame(command: int, payload: bytes) -> bytes:
    """Return a whole frame."""
    return HEADER.pack(MAGIC, 8 + len(payload), command, crc16(payload)) + payload


def frames(datagram: bytes) -> list[tuple[int, bytes]]:
    """Return id and payload of each valid frame in a datagram."""
    found = []
    while len(datagram) >= HEADER.size:
        magic, size, command, crc = HEADER.unpack_from(datagram)
        payload = datagram[HEADER.size : size]
        if magic != MAGIC or size < HEADER.size or len(datagram) < size or crc16(payload) != crc:
            break
        found.append((command, payload))
        datagram = datagram[size:]
    return found


def signed(value: int) -> int:
    """Return a u16 of sign and magnitude as a number."""
    return -(value & 0x7FFF) if value & 0x8000 else value


def magnitude(value: float) -> int:
    """Return a number as a u16 of sign and magnitude."""
    size = min(round(abs(value)), 0x7FFF)
    return size | 0x8000 if value < 0 and size else size


def motion(payload: bytes, at: float, unit: float = DECIDEGREES_PER_RADIAN) -> Command:
    """Return what a motion frame commands; the unit is that of the angular velocity."""
    kind, linear, angular = struct.unpack("<BHH", payload)
    return Command(at, KINDS[kind], signed(linear) / 1000, signed(angular) / unit)


def velocity(linear: float, angular: float) -> bytes:
    """Return the velocity frame for m/s and rad/s."""
    angular *= DECIDEGREES_PER_RADIAN
    return frame(MOTION, struct.pack("<HH", magnitude(linear * 1000), magnitude(angular)))


def distance(metres: float, radians: float) -> bytes:
    """Return the counters' frame; the heading wraps at half a turn."""
    heading = (round(radians * DECIDEGREES_PER_RADIAN) + 1800) % 3600 - 1800
    return frame(DISTANCE, struct.pack("<ii", round(metres * 1000), heading))
