"""The board's frames as the bridge reads and sends them."""

from typing import Any

from bench.codec.candidate import Candidate, readers
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.framing import Framing, Received, Rejected
from common.wire.reports import FROM_BOARD, BumperReport, UltrasonicReport, VelocityReport

Part = Received | Rejected

_framing = Framing()


def _from_board(datagram: bytes) -> list[Part]:
    return list(_framing.read(datagram, FROM_BOARD))


def _to_board(datagram: bytes) -> list[Part]:
    return list(_framing.read(datagram, TO_BOARD))


def _plain(name: str, parts: list[Part]) -> tuple[Any, ...]:
    (part,) = parts
    match part:
        case Received(frame=VelocityReport() as it):
            return it.linear_mmps, it.angular_raw
        case Received(frame=MotionCommand() as it):
            return it.kind, it.linear_mmps, it.angular_raw
        case Received(frame=BumperReport() as it):
            return (it.on,)
        case Received(frame=UltrasonicReport() as it):
            return it.ranges_mm
    raise ValueError(f"no {name}: {part}")


T2 = Candidate(
    name="T2",
    encode={
        "velocity report": lambda values: _framing.pack(VelocityReport(*values)),
        "run command": lambda values: _framing.pack(
            MotionCommand(MotionKind(values[0]), values[1], values[2])
        ),
        "bumper report": lambda values: _framing.pack(BumperReport(*values)),
        "ultrasonic report": lambda values: _framing.pack(UltrasonicReport(values)),
    },
    decode=readers(_from_board, _to_board),
    plain=_plain,
)
