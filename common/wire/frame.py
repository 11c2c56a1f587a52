"""What every frame is made of: a payload with a layout, and the number formats of this wire.

Velocities are sign and magnitude: bit 15 is the sign, bits 14..0 the magnitude (manual 2.2).
A frame object always holds values that the wire can carry: making one from others raises
``WireError``.
"""

from dataclasses import dataclass
from enum import IntEnum
from struct import Struct
from typing import ClassVar, Self

from common.errors import WireError

SIGN_BIT = 0x8000
MAGNITUDE_MAX = 0x7FFF


def to_sign_magnitude(value: int) -> int:
    """Encode a velocity of at most 15 bits and a sign; zero is always 0x0000, never 0x8000."""
    check(-MAGNITUDE_MAX <= value <= MAGNITUDE_MAX, "velocity", value, "-32767..32767")
    return value if value >= 0 else SIGN_BIT | -value


def from_sign_magnitude(raw: int) -> int:
    """Decode a u16 velocity; 0x8000 reads as zero."""
    magnitude = raw & MAGNITUDE_MAX
    return -magnitude if raw & SIGN_BIT else magnitude


def check(valid: bool, field: str, value: object, allowed: str) -> None:
    """Raise ``WireError`` with the field, its value and what is allowed."""
    if not valid:
        raise WireError(f"{field} is {value}, allowed is {allowed}")


class Side(IntEnum):
    """Which of the two motor drivers (manual 2.7)."""

    LEFT = 0
    RIGHT = 1


def to_side(value: int) -> Side:
    """Read the side byte of a motor driver frame."""
    check(value <= Side.RIGHT, "motor driver", value, "0 left, 1 right")
    return Side(value)


@dataclass(frozen=True, slots=True)
class Frame:
    """A payload without fields; those with fields say how they are packed."""

    ID: ClassVar[int]
    LAYOUT: ClassVar[Struct] = Struct("<")

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return b""

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload of exactly ``LAYOUT.size`` bytes; raise ``WireError`` for any other."""
        return cls(*cls.unpack(payload))

    @classmethod
    def unpack(cls, payload: bytes) -> tuple[int, ...]:
        """Split a payload by ``LAYOUT``; raise ``WireError`` for another size."""
        size = cls.LAYOUT.size
        check(len(payload) == size, f"{cls.__name__} payload size", len(payload), f"{size} bytes")
        return cls.LAYOUT.unpack(payload)


@dataclass(frozen=True, slots=True)
class Switch(Frame):
    """A payload of one byte: 0 off, 1 on."""

    LAYOUT = Struct("<B")

    on: bool

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(self.on)

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Read a payload; raise ``WireError`` when it is none."""
        (value,) = cls.unpack(payload)
        check(value <= 1, cls.__name__, value, "0 or 1")
        return cls(bool(value))


def by_id(*frames: type[Frame]) -> dict[int, type[Frame]]:
    """Index frame classes by the command id of their header."""
    return {frame.ID: frame for frame in frames}
