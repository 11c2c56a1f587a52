"""``python -m bench.loop board PORT ""``: one process with a loop over a socket.

It knows frames and CRC, answers a bumper hit with BRAKE and everything else with STOP. The pairs
of processes use its frames and its socket.
"""

import socket
import struct
import sys
import threading
from collections.abc import Callable

import crcmod.predefined

from common import realtime

CRC = crcmod.predefined.mkCrcFun("crc-16")
HEADER = struct.Struct("<2sHHH")
BUMPER, MOTION = 0x7602, 0x7426
STOP, RUN, BREAK = 0, 1, 2
Call = Callable[[], object]
# Joins a bus: address, name of the sent messages, of the received ones, what is called for each
# (None: it is answered). Returns what sends a message.
Join = Callable[[str, str, str, Call | None], Call]


def framed(command_id: int, payload: bytes = b"") -> bytes:
    """Return a frame."""
    return HEADER.pack(b"GS", HEADER.size + len(payload), command_id, CRC(payload)) + payload


def command(kind: int, linear_mmps: int = 0) -> bytes:
    """Return a motion frame, forward or standing."""
    return framed(MOTION, struct.pack("<BHH", kind, linear_mmps, 0))


def content(datagram: bytes) -> tuple[int, bytes] | None:
    """Return command id and payload of a datagram with one valid frame, else None."""
    if len(datagram) < HEADER.size:
        return None
    magic, size, command_id, crc = HEADER.unpack_from(datagram)
    payload = datagram[HEADER.size : size]
    valid = magic == b"GS" and size == len(datagram) and crc == CRC(payload)
    return (command_id, payload) if valid else None


def is_hit(datagram: bytes) -> bool:
    """Return whether a datagram is a valid bumper report of a pressed bumper."""
    return content(datagram) == (BUMPER, b"\1")


class BoardSocket:
    """The socket to the board."""

    def __init__(self, port: int) -> None:
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind(("127.0.0.1", port))
        self._stop, self._brake = command(STOP), command(BREAK)
        self._board = ("127.0.0.1", port)

    def receive_hit(self) -> bool:
        """Wait for a datagram; return whether it is a hit, else answer STOP."""
        datagram, self._board = self.sock.recvfrom(2048)
        if is_hit(datagram):
            return True
        self.sock.sendto(self._stop, self._board)
        return False

    def brake(self) -> None:
        """Send BRAKE; callable from any thread."""
        self.sock.sendto(self._brake, self._board)


def run_pair(join: Join) -> None:
    """Run one of two processes on a bus: ``board PORT WHERE`` or ``decide WHERE``."""
    realtime.request(realtime.BRIDGE)
    realtime.share_cpu()
    role, *given = sys.argv[1:]
    if role == "decide":
        _send = join(given[0], "verdicts", "hits", None)
        threading.Event().wait()
    board = BoardSocket(int(given[0]))
    send = join(given[1], "hits", "verdicts", board.brake)
    while True:
        if board.receive_hit():
            send()


def answer_itself(_where: str, _writes: str, _reads: str, take: Call | None) -> Call:
    """Join no bus: the process at the board decides."""
    assert take is not None
    return take


if __name__ == "__main__":
    run_pair(answer_itself)
