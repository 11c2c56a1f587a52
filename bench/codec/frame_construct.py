"""The board's frames as declarations of ``construct``."""

from io import BytesIO
from typing import Any

from construct import (
    Array,
    Check,
    Checksum,
    Const,
    Container,
    ExprAdapter,
    Int8ul,
    Int16ul,
    OneOf,
    Padding,
    Pointer,
    RawCopy,
    Rebuild,
    Struct,
    Switch,
    Tell,
    this,
)

from bench.codec.candidate import Candidate, readers, writers
from bench.codec.frame_struct import Values, crc, from_wire, to_wire

VELOCITY = ExprAdapter(
    Int16ul,
    decoder=lambda raw, context: from_wire(raw),
    encoder=lambda value, context: to_wire(value),
)
PRESSED = ExprAdapter(
    Int8ul, decoder=lambda raw, context: raw != 0, encoder=lambda value, context: int(value)
)
REPORTS = {
    0x7426: (4, Struct("linear" / VELOCITY, "angular" / VELOCITY)),
    0x7602: (1, Struct("pressed" / PRESSED)),
    0x7601: (16, Struct("ranges" / Array(8, Int16ul))),
}
COMMANDS = {
    0x7426: (
        5,
        Struct("kind" / OneOf(Int8ul, (0, 1, 2)), "linear" / VELOCITY, "angular" / VELOCITY),
    ),
}


def frame(kinds: dict[int, tuple[int, Any]]) -> Any:
    """Return the declaration of a frame whose payload is one of these, with its size."""
    return Struct(
        "start" / Tell,
        "magic" / Const(b"GS"),
        "size" / Rebuild(Int16ul, lambda context: 8 + kinds[context.id][0]),
        "id" / OneOf(Int16ul, tuple(kinds)),
        "right_size" / Check(lambda context: context.size == 8 + kinds[context.id][0]),
        Padding(2),
        "payload" / RawCopy(Switch(this.id, {number: it for number, (_, it) in kinds.items()})),
        "crc" / Pointer(this.start + 6, Checksum(Int16ul, crc, this.payload.data)),
    )


REPORT, COMMAND = frame(REPORTS), frame(COMMANDS)


def read(datagram: bytes, declared: Any) -> list[Any]:
    """Return all frames of a datagram; raise ``ConstructError`` for a bad one."""
    stream, end = BytesIO(datagram), len(datagram)
    frames = []
    while stream.tell() < end:
        frames.append(declared.parse_stream(stream))
    return frames


def _made(declared: Any, command_id: int, **payload: Any) -> bytes:
    made: bytes = declared.build({"id": command_id, "payload": {"value": payload}})
    return made


def _report(datagram: bytes) -> list[Any]:
    return read(datagram, REPORT)


def _command(datagram: bytes) -> list[Any]:
    return read(datagram, COMMAND)


def _plain(name: str, frames: list[Any]) -> Values:
    (one,) = frames
    payload: Container = one.payload.value
    values = [value for field, value in payload.items() if not field.startswith("_")]
    return tuple(values[0]) if name == "ultrasonic report" else tuple(values)


CONSTRUCT = Candidate(
    name="construct",
    encode=writers(
        velocity=lambda values: _made(REPORT, 0x7426, linear=values[0], angular=values[1]),
        motion=lambda values: _made(
            COMMAND, 0x7426, kind=values[0], linear=values[1], angular=values[2]
        ),
        bumper=lambda values: _made(REPORT, 0x7602, pressed=values[0]),
        ultrasonic=lambda values: _made(REPORT, 0x7601, ranges=values),
    ),
    decode=readers(_report, _command),
    plain=_plain,
    calls=10,
)
