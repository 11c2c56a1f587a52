"""The board's frames as the bridge reads and sends them."""

from typing import Any

from bench.codec.candidate import Candidate, readers, writers
from common.wire.commands import MOTION_KINDS, TO_BOARD, MotionCommand
from common.wire.framing import Framing, Received, Rejected
from common.wire.reports import FROM_BOARD, BumperReport, UltrasonicReport, VelocityReport

Part = Received | Rejected

_framing = Framing()


def _from_board(datagram: bytes) -> list[Part]:
    return _framing.read(datagram, FROM_BOARD)


def _to_board(datagram: bytes) -> list[Part]:
    return _framing.read(datagram, TO_BOARD)


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
    encode=writers(
        velocity=lambda values: _framing.pack(VelocityReport(values[0], values[1])),
        motion=lambda values: _framing.pack(
            MotionCommand(MOTION_KINDS[values[0]], values[1], values[2])
        ),
        bumper=lambda values: _framing.pack(BumperReport(values[0])),
        ultrasonic=lambda values: _framing.pack(UltrasonicReport(values)),
    ),
    decode=readers(_from_board, _to_board),
    plain=_plain,
)
