"""MessagePack encoding and type-checked decoding of messages."""

from functools import cache
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from t2.errors import MessageError
from t2.messages import Refusal

S = TypeVar("S", bound=Struct)

ENCODING = "application/msgpack"
PREFIX = f"{ENCODING};t2.v1."
EMPTY = b"\x80"  # an empty map: all fields have their defaults

_encoder = msgspec.msgpack.Encoder()


def encode(message: Struct) -> bytes:
    """Return the message as a MessagePack map."""
    return _encoder.encode(message)


def decode(payload: bytes, kind: type[S]) -> S:
    """Decode a MessagePack map; raise ``MessageError`` naming the field that does not fit."""
    try:
        message: S = _decoder(kind).decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise MessageError(f"not a {kind.__name__}: {error}") from None
    return message


def refusal(payload: bytes) -> Refusal:
    """Return the error reply to a call; another program's is taken as text."""
    try:
        return decode(payload, Refusal)
    except MessageError:
        return Refusal(text=payload.decode(errors="replace") or "refused without a reason")


def encoding(kind: type[Struct]) -> str:
    """Return the encoding string of a type, ``application/msgpack;t2.v1.Kind``."""
    return PREFIX + kind.__name__


def kind_of(encoding: str) -> str:
    """Return the type name in an encoding, such as ``Odometry``, or an empty string."""
    return encoding.removeprefix(PREFIX) if encoding.startswith(PREFIX) else ""


class Sample(Struct, frozen=True):
    """A message that is not decoded, or anything else on the bus."""

    key: str
    payload: bytes
    encoding: str
    deleted: bool  # a DELETE, not a PUT
    raw: bytes | None  # attachment: the board's raw frame, on the bridge's streams
    received_ns: int  # on the monotonic clock
    wall_ns: int  # received, on the wall clock

    @property
    def size(self) -> int:
        """Size in bytes, without network overhead."""
        return len(self.payload) + len(self.raw or b"")


@cache
def _decoder(kind: type[Struct]) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(kind)
