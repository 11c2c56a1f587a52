"""Frame base class: header, and the fields of a payload.

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

from collections.abc import Mapping
from enum import IntEnum
from struct import Struct
from typing import Any, ClassVar, Self

import msgspec
from msgspec.structs import astuple

from common.errors import WireError

MAGIC = b"GS"
OPENING = Struct("<2sHH")  # magic, size, id
HEADER = Struct("<6sH")  # opening, CRC
PAYLOAD_OFFSET = 8

SIGN_BIT = 0x8000
MAGNITUDE_MAX = 0x7FFF


class Field(msgspec.Struct, frozen=True):
    """A number of a payload: its code in ``struct``, its limits, and its meaning if it has few."""

    code: str = "B"
    lowest: int = 0
    highest: int = 0xFF
    meaning: Mapping[int, Any] = {}  # by the number on the wire

    def check(self, name: str, value: Any) -> None:
        """Raise ``WireError`` for a value that the wire cannot carry."""
        if self.meaning:
            if value not in self.meaning.values():
                raise refusal(name, value, ", ".join(map(str, self.meaning)))
        elif not self.lowest <= value <= self.highest:
            raise refusal(name, value, f"{self.lowest}..{self.highest}")

    def decode(self, name: str, number: int) -> Any:
        """Return the value of the field of this name; raise ``WireError`` for an unknown one."""
        if self.meaning and number not in self.meaning:
            raise refusal(name, number, ", ".join(map(str, self.meaning)))
        return self.meaning.get(number, number)

    def encode(self, value: Any) -> int:
        """Return the number on the wire."""
        return next((number for number, one in self.meaning.items() if one == value), value)


class Velocity(Field, frozen=True):
    """Sign and magnitude; 0x8000 is read as zero and never sent."""

    def decode(self, name: str, number: int) -> int:
        """Return the signed value."""
        return number if number < SIGN_BIT else SIGN_BIT - number

    def encode(self, value: int) -> int:
        """Return sign and magnitude."""
        return value if value >= 0 else SIGN_BIT - value


class Side(IntEnum):
    """Side of a motor driver (manual 2.7)."""

    LEFT = 0
    RIGHT = 1


OCTET = Field()
SWITCH = Field(meaning={0: False, 1: True})
SIDE = Field(meaning={side.value: side for side in Side})
VELOCITY = Velocity("H", -MAGNITUDE_MAX, MAGNITUDE_MAX)


class Frame(msgspec.Struct, frozen=True, gc=False):
    """A frame without payload; subclasses have a row of ``FIELDS`` for each attribute."""

    ID: ClassVar[int] = 0  # placeholder; no frame has this id
    FIELDS: ClassVar[tuple[Field, ...]] = ()
    LAYOUT: ClassVar[Struct]  # of the payload
    SIZE: ClassVar[int]  # of the whole frame, header included
    OPENING: ClassVar[bytes]  # of its header

    def __init_subclass__(cls) -> None:
        cls.LAYOUT = Struct("<" + "".join(field.code for field in cls.FIELDS))
        cls.SIZE = HEADER.size + cls.LAYOUT.size
        cls.OPENING = OPENING.pack(MAGIC, cls.SIZE, cls.ID)

    def __post_init__(self) -> None:
        for name, field in zip(self.__struct_fields__, self.FIELDS, strict=True):
            field.check(name, getattr(self, name))

    def to_bytes(self) -> bytes:
        """Return the payload, without the header."""
        values = zip(self.FIELDS, astuple(self), strict=True)
        return self.LAYOUT.pack(*[field.encode(value) for field, value in values])

    @classmethod
    def from_wire(cls, numbers: tuple[int, ...]) -> Self:
        """Decode the numbers of ``LAYOUT``; raise ``WireError`` for invalid ones."""
        rows = zip(cls.FIELDS, cls.__struct_fields__, numbers, strict=True)
        return cls(*[field.decode(name, number) for field, name, number in rows])


Kinds = Mapping[bytes, type[Frame]]  # by their opening


def by_opening(*frames: type[Frame]) -> Kinds:
    """Index frame classes by their opening."""
    return {frame.OPENING: frame for frame in frames}


def refusal(field: str, value: object, allowed: str) -> WireError:
    """Return the error that names a field, its value and what is allowed."""
    return WireError(f"{field} is {value}, allowed is {allowed}")
