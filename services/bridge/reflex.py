"""The reflex: BRAKE for a bumper hit, before anything else is read of its datagram. Pure."""

from common.motion import Command
from common.wire.commands import MotionCommand, MotionKind
from common.wire.framing import Framing, Received
from common.wire.reports import FROM_BOARD, BumperReport
from services.bridge.output import Send


class Reflex:
    """Finds a hit anywhere in a datagram; fast when there is none."""

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._brake = framing.pack(MotionCommand(MotionKind.BREAK))
        self._hit = framing.pack(BumperReport(True))
        self._clear = framing.pack(BumperReport(False))

    def answer(self, datagram: bytes, port: int) -> Send | None:
        """Return BRAKE, from this port, when a datagram holds a pressed bumper."""
        return Send(self._brake, port, Command.BRAKE) if self._is_hit(datagram) else None

    def _is_hit(self, datagram: bytes) -> bool:
        if datagram == self._hit:
            return True
        if datagram == self._clear or BumperReport.OPENING not in datagram:
            return False
        parts = self._framing.read(datagram, FROM_BOARD)
        frames = (part.frame for part in parts if isinstance(part, Received))
        return any(isinstance(frame, BumperReport) and frame.on for frame in frames)
