"""The reflex: BRAKE for a bumper hit, before the rest of its datagram is read. Pure."""

from msgspec import Struct

from common.motion import Command
from common.wire.commands import MotionCommand, MotionKind
from common.wire.framing import Framing, Received
from common.wire.reports import FROM_BOARD, BumperReport
from services.bridge.output import Send


class Hit(Struct, frozen=True):
    """A bumper hit: its frame, and the BRAKE to send at once."""

    raw: bytes
    brake: Send


class Reflex:
    """Detects a bumper hit anywhere in a datagram; fast path without one."""

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._brake = framing.pack(MotionCommand(MotionKind.BREAK))
        self._hit = framing.pack(BumperReport(True))
        self._clear = framing.pack(BumperReport(False))

    def answer(self, datagram: bytes, port: int) -> Hit | None:
        """Return the hit with its BRAKE, from this port, when a datagram holds a pressed bumper."""
        raw = datagram if datagram == self._hit else self._search(datagram)
        return Hit(raw, Send(self._brake, port, Command.BRAKE)) if raw else None

    def _search(self, datagram: bytes) -> bytes:
        """Return the first frame with a pressed bumper, otherwise empty."""
        if datagram == self._clear or BumperReport.OPENING not in datagram:
            return b""
        for part in self._framing.read(datagram, FROM_BOARD):
            frame = part.frame if isinstance(part, Received) else None
            if isinstance(frame, BumperReport) and frame.on:
                return part.raw
        return b""
