"""Frame base class: header, payload layout, and number formats of this wire.

Velocities are sign and magnitude: bit 15 is the sign, bits 14..0 the magnitude (manual 2.2).
A frame object holds only values that the wire can carry: its constructor raises ``WireError`` for
others, and sending needs no check.

Every frame begins with a header, little-endian (manual 2.1):

====== ======= ========================================================================
offset bytes   field
====== ======= ========================================================================
0      2       magic, ``47 53`` ("GS")
2      2       size of the whole frame, header included
4      2       command id, see ``commands`` and ``reports``
6      2       CRC, over the payload alone: the header is not protected
8      size-8  payload
====== ======= ========================================================================

The bytes before the CRC are the same in all frames of a kind: the *opening* identifies the kind.
"""

from collections.abc import Callable, Mapping
from enum import IntEnum
from struct import Struct
from typing import ClassVar, NamedTuple, Self, TypeVar

import msgspec
from msgspec.structs import astuple

from common.errors import WireError

MAGIC = b"GS"
OPENING = Struct("<2sHH")  # magic, size, id
HEADER = Struct("<6sH")  # opening, CRC
CRC_OFFSET, PAYLOAD_OFFSET = 6, 8

SIGN_BIT = 0x8000
MAGNITUDE_MAX = 0x7FFF
SIGNED_15_BITS = (-MAGNITUDE_MAX, MAGNITUDE_MAX)

T = TypeVar("T")
Limits = Mapping[str, tuple[int, int]]  # lowest and highest value by field


def to_sign_magnitude(value: int) -> int:
    """Encode a velocity that a frame holds; zero is always 0x0000, never 0x8000."""
    return value if value >= 0 else SIGN_BIT - value


def from_sign_magnitude(raw: int) -> int:
    """Decode a u16 velocity; 0x8000 reads as zero."""
    return raw if raw < SIGN_BIT else SIGN_BIT - raw


def refusal(field: str, value: object, allowed: str) -> WireError:
    """Return the error that names a field, its value and what is allowed."""
    return WireError(f"{field} is {value}, allowed is {allowed}")


def chosen(field: str, value: int, choices: Mapping[int, T], allowed: str) -> T:
    """Decode a byte that has a few values; raise ``WireError`` for others."""
    if value not in choices:
        raise refusal(field, value, allowed)
    return choices[value]


def side_of(value: int) -> "Side":
    """Decode the side byte of a motor driver frame."""
    return chosen("motor driver", value, SIDES, "0 left, 1 right")


class Side(IntEnum):
    """Side of a motor driver (manual 2.7)."""

    LEFT = 0
    RIGHT = 1


# By the byte on the wire; this lookup takes a fifth of ``Side(value)``.
SIDES = {side.value: side for side in Side}


class Frame(msgspec.Struct, frozen=True, gc=False):
    """A frame without payload; subclasses with fields define the layout of these."""

    ID: ClassVar[int] = 0  # placeholder; no frame has this id
    LAYOUT: ClassVar[Struct] = Struct("<")
    LIMITS: ClassVar[Limits] = {}
    OPENING: ClassVar[bytes]  # of its header

    def __init_subclass__(cls) -> None:
        cls.OPENING = OPENING.pack(MAGIC, HEADER.size + cls.LAYOUT.size, cls.ID)

    def __post_init__(self) -> None:
        for field, (lowest, highest) in self.LIMITS.items():
            if not lowest <= getattr(self, field) <= highest:
                raise refusal(field, getattr(self, field), f"{lowest}..{highest}")

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        return self.LAYOUT.pack(*astuple(self))

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode the values of ``LAYOUT``; raise ``WireError`` for invalid ones."""
        return cls(*values)


class Switch(Frame, frozen=True):
    """A payload of one byte: 0 off, 1 on."""

    LAYOUT = Struct("<B")

    on: bool

    @classmethod
    def from_wire(cls, values: tuple[int, ...]) -> Self:
        """Decode its byte; raise ``WireError`` for values other than 0 and 1."""
        return cls(chosen(cls.__name__, values[0], {0: False, 1: True}, "0 or 1"))


class Kind(NamedTuple):
    """A frame class with precomputed decoding functions."""

    frame: type[Frame]
    size: int  # of the whole frame, header included
    unpack: Callable[[bytes], tuple[int, ...]]
    from_wire: Callable[[tuple[int, ...]], Frame]


Kinds = Mapping[bytes, Kind]


def by_opening(*frames: type[Frame]) -> Kinds:
    """Index frame classes by their opening."""
    return {
        frame.OPENING: Kind(
            frame, HEADER.size + frame.LAYOUT.size, frame.LAYOUT.unpack, frame.from_wire
        )
        for frame in frames
    }
