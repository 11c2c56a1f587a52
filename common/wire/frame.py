"""What every frame is made of: a payload with a layout, and the number formats of this wire.

Velocities are sign and magnitude: bit 15 is the sign, bits 14..0 the magnitude (manual 2.2).
A frame object always holds values that the wire can carry: making one from others raises
``WireError``, and sending it checks nothing again.
"""

from collections.abc import Callable, Mapping
from enum import IntEnum
from struct import Struct
from typing import ClassVar, NamedTuple, Self

import msgspec

from common.errors import WireError
from common.wire.header import HEADER, MAGIC, OPENING

SIGN_BIT = 0x8000
MAGNITUDE_MAX = 0x7FFF


def to_sign_magnitude(value: int) -> int:
    """Encode a velocity that a frame holds; zero is always 0x0000, never 0x8000."""
    return value if value >= 0 else SIGN_BIT - value


def from_sign_magnitude(raw: int) -> int:
    """Decode a u16 velocity; 0x8000 reads as zero."""
    return raw if raw < SIGN_BIT else SIGN_BIT - raw


def refusal(field: str, value: object, allowed: str) -> WireError:
    """Return the error that names a field, its value and what is allowed."""
    return WireError(f"{field} is {value}, allowed is {allowed}")


def too_fast(*velocities: int) -> WireError:
    """Return the error that names the one that is furthest beyond 15 bits."""
    return refusal("velocity", max(velocities, key=abs), "-32767..32767")


class Side(IntEnum):
    """Which of the two motor drivers (manual 2.7)."""

    LEFT = 0
    RIGHT = 1


def to_side(value: int) -> Side:
    """Read the side byte of a motor driver frame."""
    if value > Side.RIGHT:
        raise refusal("motor driver", value, "0 left, 1 right")
    return Side(value)


class Frame(msgspec.Struct, frozen=True, gc=False):
    """A payload without fields; those with fields say how they are packed."""

    ID: ClassVar[int] = 0  # no frame that is sent has this one
    LAYOUT: ClassVar[Struct] = Struct("<")
    OPENING: ClassVar[bytes]  # of its header

    def __init_subclass__(cls) -> None:
        cls.OPENING = OPENING.pack(MAGIC, HEADER.size + cls.LAYOUT.size, cls.ID)

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return b""

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Make it of what ``LAYOUT`` found in a payload; raise ``WireError`` if it cannot be."""
        return cls(*values)


class Switch(Frame, frozen=True):
    """A payload of one byte: 0 off, 1 on."""

    LAYOUT = Struct("<B")

    on: bool

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return b"\x01" if self.on else b"\x00"

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Make it of its byte; raise ``WireError`` for neither 0 nor 1."""
        (value,) = values
        if value > 1:
            raise refusal(cls.__name__, value, "0 or 1")
        return cls(value == 1)


class Kind(NamedTuple):
    """A frame class, with all that reading takes looked up already."""

    frame: type[Frame]
    size: int  # of the whole frame, header included
    unpack: Callable[[bytes], tuple[int, ...]]
    from_wire: Callable[[tuple[int, ...]], Frame]


Kinds = Mapping[bytes, Kind]


def by_opening(*frames: type[Frame]) -> Kinds:
    """Index frame classes by what their frames begin with."""
    return {
        frame.OPENING: Kind(
            frame, HEADER.size + frame.LAYOUT.size, frame.LAYOUT.unpack, frame.from_wire
        )
        for frame in frames
    }
